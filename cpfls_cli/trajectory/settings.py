"""Settings of the section `trajectory`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings
from cpfls_cli.trajectory.consistency import check_consistency
from cpfls_cli.trajectory.legs import MoveInSpace, Timing, move_in_space, unit_of
from cpfls_cli.trajectory.profile import BaseProfile, Holds, LimitSettings

_Turns = Annotated[int, Ge(-10_000), Le(10_000)]
_Torque = Annotated[float, Gt(0)]
_Length = Annotated[float, Gt(0)]
PathKind = Literal["cube-diagonal", "straight", "waypoints", "hover", "next-flight", "full-rotation", "optimised"]
ExcitedAxis = Literal["roll", "pitch", "yaw", "vertical"]
_USUAL_PERIOD = 1.0
_ROTATIONS = ("full-rotation", "optimised")


@dataclass(frozen=True, kw_only=True)
class RotationSettings(Settings):
    """Describe a periodic path on which roll, pitch and yaw turn through complete circles.

    Every limit holds at all times for each component: those on rate and acceleration for the Euler angles and for
    the body alike.
    """

    turns: Annotated[
        tuple[_Turns, _Turns, _Turns] | None,
        Doc("complete turns of roll, pitch and yaw over the duration, negative backwards; null chooses them"),
    ] = None
    frequency_max_hz: Annotated[
        float, Gt(0), Doc("highest frequency of the harmonics that are superposed on the turns, Hz")
    ] = 0.5
    rate_max_rad_s: Annotated[float, Gt(0), Doc("largest rate of an Euler angle and of the body, rad/s")] = 6.0
    acceleration_max_rad_s2: Annotated[
        float, Gt(0), Doc("largest acceleration of an Euler angle and of the body, rad/s^2")
    ] = 12.0
    torque_max_n_m: Annotated[
        tuple[_Torque, _Torque, _Torque] | None,
        Doc("largest torque on the body about x, y, z that the motion may ask for, N m; null: no limit"),
    ] = None
    starts: Annotated[int, Ge(1), Doc("random paths of an optimised path, the best of which is improved")] = 10
    iterations: Annotated[int, Ge(0), Doc("steps of gradient descent that improve an optimised path")] = 400


@dataclass(frozen=True, kw_only=True)
class NextFlightSettings(Settings):
    """Describe the flight that distinguishes rivals: which, and the space that it may use."""

    to_tell: Annotated[
        tuple[str, ...],
        Doc("effects to distinguish (`cpfls effects`); one alone: to show; none: those that the diagnosis leaves open"),
    ] = ()
    box_m: Annotated[
        tuple[_Length, _Length, _Length],
        Doc("space for the vehicle with its propellers along world x, y and z, m, about x = y = 0"),
    ] = (10.0, 10.0, 4.0)
    height_m: Annotated[float, Gt(0), Doc("height of the middle of the box above gap.ground_height_m, m")] = 4.0
    frequency_max_hz: Annotated[float, Gt(0), Doc("highest frequency of the harmonics of position and yaw, Hz")] = 1.0
    starts: Annotated[int, Ge(1), Doc("random paths, the best of which is improved")] = 40
    iterations: Annotated[int, Ge(0), Doc("changes that are tried on it")] = 300


@dataclass(frozen=True, kw_only=True)
class ExciteSettings(Settings):
    """Describe a test signal that is added to a path in space, from rest to rest."""

    axes: Annotated[
        tuple[ExcitedAxis, ...],
        Doc("what is excited, each apart from the others: roll, pitch, yaw, vertical; none: nothing is added"),
    ] = ()
    signal: Annotated[
        Literal["multisine", "sweep-linear", "sweep-logarithmic"],
        Doc(
            "multisine: all axes at once, each at frequencies of its own, of a low crest factor; sweep-linear, "
            "sweep-logarithmic: one frequency after another, axis after axis"
        ),
    ] = "multisine"
    band_hz: Annotated[
        tuple[Annotated[float, Gt(0)], Annotated[float, Gt(0)]], Doc("lowest and highest frequency, Hz")
    ] = (0.5, 5.0)
    size_rad: Annotated[
        float,
        Gt(0),
        Le(0.5),
        Doc(
            "largest angle, rad, less where the vehicle cannot; amplitudes fall with frequency, rates are equal in the "
            "band; of vertical the angle of a tilt with as much acceleration"
        ),
    ] = 0.1
    velocity_max_m_s: Annotated[float, Gt(0), Doc("largest velocity that the excitation adds, m/s")] = 1.0


@dataclass(frozen=True, kw_only=True)
class WaypointSettings(Settings):
    """Describe a point at which the vehicle comes to rest."""

    position_m: Annotated[tuple[float, float, float], Doc("position, m, world frame with z up")]
    yaw_rad: Annotated[
        float | None, Doc("yaw there, rad, turned to while it moves; null at all of them: see yaw_turn_rad")
    ] = None
    pause_s: Annotated[float, Ge(0), Doc("rest there beside pause_s of the path, s")] = 0.0


@dataclass(frozen=True, kw_only=True)
class TrajectorySettings(Settings):
    """Describe a path of rest-to-rest moves in space, or full rotations of a vehicle that is held."""

    path: Annotated[
        PathKind,
        Doc(
            "cube-diagonal: to and fro along (1, 1, 1); straight: along `direction`; waypoints: from point to point; "
            "hover: at one place; "
            "next-flight: what distinguishes rivals of a diagnosis, harmonics from rest to rest; "
            "full-rotation, optimised: held at its centre of mass, turns through complete circles, at random or as "
            "conditions the model of `identification` best"
        ),
    ] = "cube-diagonal"
    direction: Annotated[
        tuple[float, float, float],
        Doc("direction of a straight path, world frame with z up; any length but zero"),
    ] = (1.0, 1.0, 1.0)
    legs: Annotated[int, Ge(1), Le(10_000), Doc("number of moves to and fro: out, back, out, ...")] = 3
    displacement_m: Annotated[
        float | None,
        Doc("displacement of a move to or fro, m; null when amplitude_m_s5 is given"),
    ] = 64.0
    displacement_measure: Annotated[
        Literal["along-path", "per-axis"],
        Doc("whether displacement and limits hold along the path or on the axis that moves most"),
    ] = "along-path"
    amplitude_m_s5: Annotated[
        float | None,
        Doc("crackle amplitude A, m/s^5; null chooses the one that covers the displacement exactly"),
    ] = None
    waypoints: Annotated[
        tuple[WaypointSettings, ...],
        Doc("the points of path: waypoints, two or more; `cpfls trajectory --waypoints FILE` reads them of a CSV"),
    ] = ()
    limits: Annotated[
        LimitSettings, Doc("limits under which every move is as short as can be; they choose its holds and amplitude")
    ] = field(default_factory=LimitSettings)
    coordination: Annotated[
        Literal["straight-line", "each-axis"],
        Doc("under limits: all axes in step along a straight line, or each at its own best and as long as the slowest"),
    ] = "straight-line"
    period_s: Annotated[
        Annotated[float, Gt(0)] | None,
        Doc("period P of one sine wave of the pop, s; null: chosen by the limits, and 1 s where there are none"),
    ] = None
    hold_snap_s: Annotated[float, Ge(0), Doc("hold of constant snap, s, 8 times a move")] = 0.0
    hold_jerk_s: Annotated[float, Ge(0), Doc("hold of constant jerk, s, 4 times a move")] = 0.0
    hold_acceleration_s: Annotated[float, Ge(0), Doc("hold of constant acceleration, s, twice a move")] = 0.0
    hold_velocity_s: Annotated[float, Ge(0), Doc("hold of constant velocity, s, once a move")] = 0.0
    duration_s: Annotated[
        Annotated[float, Gt(0)] | None,
        Doc(
            "duration, s; what the moves leave of it is rest, shared equally between them; null: as long as moves and "
            "pauses take"
        ),
    ] = 54.86
    pause_s: Annotated[float, Ge(0), Doc("rest between two moves, s, where duration_s is null")] = 0.0
    sample_time_s: Annotated[float, Gt(0), Doc("time between samples, s")] = 0.01
    yaw_turn_rad: Annotated[
        float | None,
        Doc(
            "yaw turned over the whole duration, rad, unless the waypoints have a yaw; null: a full turn on a path to "
            "and fro, none through waypoints, in hover and where something is excited"
        ),
    ] = None
    yaw_profile: Annotated[
        Literal["base", "uniform"],
        Doc("base: yaw follows the first move's profile, stretched, from rest to rest; uniform: constant rate"),
    ] = "base"
    rotation: Annotated[RotationSettings, Doc("for paths full-rotation and optimised")] = field(
        default_factory=RotationSettings
    )
    next_flight: Annotated[NextFlightSettings, Doc("for path next-flight")] = field(default_factory=NextFlightSettings)
    excite: Annotated[ExciteSettings, Doc("test signal that is added to a path in space")] = field(
        default_factory=ExciteSettings
    )
    repeat: Annotated[int, Ge(1), Le(1000), Doc("runs of a path in space, each the same from rest to rest")] = 1
    repeat_pause_s: Annotated[
        float, Ge(0), Doc("rest before the next run, s, after the way back to the start where the path ends elsewhere")
    ] = 5.0
    tilt_max_rad: Annotated[
        Annotated[float, Gt(0), Le(math.pi)] | None,
        Doc("largest tilt of a path in space, rad; null: any, and 35 degrees on path next-flight"),
    ] = None
    infeasible: Annotated[
        Literal["stop", "report"],
        Doc("thrust, tilt or a rotor asked for more than the vehicle has: stop, or write the path and say so"),
    ] = "stop"

    def __post_init__(self) -> None:
        """Refuse combinations of settings that do not describe a path."""
        check_consistency(self)

    @property
    def held(self) -> bool:
        """Whether the vehicle is held at its centre of mass and only turns."""
        return self.path in _ROTATIONS

    @property
    def yaw_turn(self) -> float:
        """Yaw turned over the whole duration, rad."""
        if self.yaw_turn_rad is not None:
            return self.yaw_turn_rad
        return 0.0 if self.path in ("waypoints", "hover") or self.excite.axes else 2 * math.pi

    @property
    def period(self) -> float | None:
        """Period of the pop, s; None where the limits choose it."""
        return self.period_s if self.period_s or self.limits.given else _USUAL_PERIOD

    @property
    def holds(self) -> Holds:
        """Holds of a move that no limits choose."""
        return Holds(
            snap=self.hold_snap_s,
            jerk=self.hold_jerk_s,
            acceleration=self.hold_acceleration_s,
            velocity=self.hold_velocity_s,
        )

    @property
    def timing(self) -> Timing:
        """Timing of a move."""
        return Timing(
            limits=self.limits,
            coordination=self.coordination,
            period=self.period,
            holds=self.holds,
            measure=self.displacement_measure,
        )

    @property
    def line(self) -> MoveInSpace:
        """First move of a path to and fro."""
        unit = unit_of(np.array(self.direction), self.displacement_measure)[1]
        if self.amplitude_m_s5 is not None:
            given = BaseProfile(amplitude=self.amplitude_m_s5, period=self.period or _USUAL_PERIOD, holds=self.holds)
            return MoveInSpace(profiles=(given,), directions=unit[None])
        if self.displacement_m is None:
            raise SettingError("displacement_m", "is missing")
        return move_in_space(self.displacement_m * unit, self.timing)
