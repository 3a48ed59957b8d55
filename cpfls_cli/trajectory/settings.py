"""Settings of the section `trajectory`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le
from typing_extensions import Doc

from cpfls_cli.arrays import Array
from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings
from cpfls_cli.trajectory.legs import MoveInSpace, checked_move, plan_move, synchronised, unit_of
from cpfls_cli.trajectory.profile import BaseProfile, Holds, LimitSettings, covering

_LARGEST_PEAK = 1e100
# Of the fastest wave of an excitation, between which an autopilot and a simulation interpolate.
_SAMPLES_IN_A_PERIOD = 10
_MAY_JUMP = ("crackle", "pop")
_OF_DURATION = "contradicts duration_s, which determines the rest between moves; set duration_s to null"
# Samples of a path, of 34 numbers each: 2.7 GB.
_LARGEST_SIZE = 10_000_000


def check_consistency(settings: TrajectorySettings) -> None:
    """Refuse a direction, a size of a move, limits or a duration that contradicts another setting."""
    if settings.held:
        _check_held(settings)
    _check_clock(settings)
    _check_excited(settings)
    _check_repeated(settings)
    if settings.held or settings.path in ("next-flight", "hover"):
        return
    _check_direction(settings)
    _check_limits(settings)
    if settings.path == "waypoints":
        # None at all may still come with a file.
        if settings.waypoints:
            check_waypoints(settings.waypoints, settings.duration_s is None)
        if settings.amplitude_m_s5 is not None:
            message = "does not apply to waypoints, whose distances determine it; set it to null"
            raise SettingError("amplitude_m_s5", message)
        return
    _check_size(settings)
    _check_moves(settings)


def _check_clock(settings: TrajectorySettings) -> None:
    if settings.duration_s is None:
        if settings.held or settings.path in ("next-flight", "hover"):
            raise SettingError("duration_s", f"is null; path {settings.path} needs a duration")
        return
    check_samples(settings.duration_s, settings.sample_time_s)
    if settings.pause_s:
        raise SettingError("pause_s", _OF_DURATION)


def _check_held(settings: TrajectorySettings) -> None:
    if settings.pause_s:
        raise SettingError("pause_s", f"does not apply to path {settings.path}, which never rests; set it to 0")
    if settings.limits.given:
        raise SettingError("limits", f"apply to moves in space; path {settings.path} has those of the key rotation")
    if settings.tilt_max_rad is not None:
        raise SettingError("tilt_max_rad", f"applies to paths in space; path {settings.path} turns full circles")


def _check_excited(settings: TrajectorySettings) -> None:
    asked = settings.excite
    if len(set(asked.axes)) < len(asked.axes):
        raise SettingError("excite.axes", "names an axis twice; name each once")
    low, high = asked.band_hz
    if low >= high:
        raise SettingError("excite.band_hz", "must rise: give the lowest frequency, then the highest")
    if not asked.axes:
        return
    if settings.held or settings.path == "next-flight":
        raise SettingError("excite.axes", f"need a path in space; path {settings.path} chooses its motion itself")
    if settings.sample_time_s > (1 + 1e-9) * coarsest_excited(asked):
        message = f"leaves fewer than {_SAMPLES_IN_A_PERIOD} samples in a period of {high:g} Hz, the top of"
        remedy = f"lower it to {coarsest_excited(asked):.3g} or less"
        raise SettingError("sample_time_s", f"{message} excite.band_hz; {remedy}")


def coarsest_excited(asked: ExciteSettings) -> float:
    """Give the largest sample time that holds an excitation, s."""
    return 1 / (_SAMPLES_IN_A_PERIOD * asked.band_hz[1])


def _check_repeated(settings: TrajectorySettings) -> None:
    if settings.repeat == 1:
        return
    if settings.held:
        raise SettingError("repeat", f"repeats a path from rest to rest; path {settings.path} never rests")
    if settings.yaw_profile == "uniform" and settings.yaw_turn:
        message = "turns at the ends of a run too, but a repeated run begins and ends at rest; use base"
        raise SettingError("yaw_profile", f"uniform {message}, or yaw_turn_rad: 0")


def _check_direction(settings: TrajectorySettings) -> None:
    if not any(settings.direction):
        raise SettingError("direction", "has length zero; give at least one component that is not 0")
    if settings.path == "cube-diagonal" and len(set(settings.direction)) > 1:
        message = "a cube-diagonal moves along (1, 1, 1); use path: straight for another direction"
        raise SettingError("direction", message)


def _check_limits(settings: TrajectorySettings) -> None:
    if not settings.limits.given:
        if settings.coordination == "each-axis":
            raise SettingError("coordination", "each-axis needs limits; give some, or use straight-line")
        return
    given = [key for key, value in asdict(settings.holds).items() if value]
    if given:
        raise SettingError(f"hold_{given[0]}_s", "contradicts limits, which determine the holds; set it to 0")
    if settings.amplitude_m_s5 is not None:
        raise SettingError("amplitude_m_s5", "contradicts limits, which determine it; set it to null")
    if settings.coordination == "each-axis" and settings.displacement_measure == "along-path":
        message = "along-path does not apply if every axis is planned by itself; use per-axis"
        raise SettingError("displacement_measure", message)


def _check_size(settings: TrajectorySettings) -> None:
    given = {"displacement_m": settings.displacement_m, "amplitude_m_s5": settings.amplitude_m_s5}
    if (settings.displacement_m is None) == (settings.amplitude_m_s5 is None):
        message = "give either displacement_m or amplitude_m_s5, and set the other to null"
        raise SettingError("amplitude_m_s5", message)
    for key, value in given.items():
        if value is not None and value <= 0:
            raise SettingError(key, "must be greater than 0")


def _check_moves(settings: TrajectorySettings) -> None:
    line = settings.line
    for profile in line.profiles:
        check_peaks(profile, "displacement_m" if settings.amplitude_m_s5 is None else "amplitude_m_s5")
    if settings.duration_s is not None:
        check_duration(settings.legs, settings.legs * line.duration, settings.duration_s)


def check_peaks(profile: BaseProfile, key: str) -> None:
    """Refuse a move whose displacement vanishes or whose derivatives overflow, by the setting that made it so."""
    if not profile.displacement:
        raise SettingError(
            key, f"with period_s = {profile.period:g} makes a move too short for floating-point numbers; raise it"
        )
    peaks = {name: value for name, value in asdict(profile.peaks).items() if name not in _MAY_JUMP}
    name, value = max(peaks.items(), key=lambda peak: peak[1])
    # The attitude multiplies up to three of them, and the largest number is 1.8e308.
    if not value < _LARGEST_PEAK:
        message = f"a move with period_s = {profile.period:g} has {name} up to {value:.3g} in m and s: too large to"
        raise SettingError(key, f"{message} compute with; lower it, or raise period_s")


def check_samples(duration: float, sample_time: float) -> None:
    """Refuse a sample time with which there would be one sample, or more than memory holds; both in s."""
    if duration > _LARGEST_SIZE * sample_time:
        raise SettingError("sample_time_s", f"divides {duration:g} s into more than {_LARGEST_SIZE} samples; raise it")
    if sample_time > duration:
        raise SettingError("sample_time_s", f"is longer than the whole path, which takes {duration:g} s")


def check_duration(moves: int, needed: float, duration: float) -> None:
    """Refuse a duration that the moves do not fit into."""
    if needed > duration * (1 + 1e-12):
        words = f"{moves} moves take" if moves > 1 else "the move takes"
        raise SettingError("duration_s", f"{words} {needed:g} s; raise it, or set it to null for as long as they take")


def check_waypoints(waypoints: Sequence[WaypointSettings], paused: bool) -> None:
    """Refuse waypoints that do not describe a path.

    Parameters
    ----------
    paused : bool
        Whether the points may have pauses of their own.

    Raises
    ------
    SettingError
        If there are fewer than two, one repeats the one before, only some have a yaw, or one has a pause that it
        must not have; it names the entry, counted from 0 as in all messages on a config.
    """
    if len(waypoints) < 2:
        raise SettingError("waypoints", f"holds {len(waypoints)}; a path needs two or more, here or in a CSV file")
    for number, (before, point) in enumerate(pairwise(waypoints), start=1):
        if before.position_m == point.position_m:
            message = "repeats the point before; remove one: a rest is pause_s, and turning on the spot is not planned"
            raise SettingError(f"waypoints.{number}.position_m", message)
    headings = [point.yaw_rad is None for point in waypoints]
    if len(set(headings)) > 1:
        message = "is missing, but other points have a yaw; give it at all of them, or at none"
        raise SettingError(f"waypoints.{headings.index(True)}.yaw_rad", message)
    for number, point in enumerate(waypoints):
        if point.pause_s and not paused:
            raise SettingError(f"waypoints.{number}.pause_s", _OF_DURATION)


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

    separate: Annotated[
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
    pause_s: Annotated[float, Ge(0), Doc("rest there on top of pause_s of the path, s")] = 0.0


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
        tuple[float, float, float], Doc("direction of a straight path, world frame with z up; any length but zero")
    ] = (1.0, 1.0, 1.0)
    legs: Annotated[int, Ge(1), Le(10_000), Doc("number of moves to and fro: out, back, out, ...")] = 3
    displacement_m: Annotated[
        float | None, Doc("displacement of a move to or fro, m; null when amplitude_m_s5 is given")
    ] = 64.0
    displacement_measure: Annotated[
        Literal["along-path", "per-axis"],
        Doc("whether displacement and limits hold along the path or on the axis that moves most"),
    ] = "along-path"
    amplitude_m_s5: Annotated[
        float | None, Doc("crackle amplitude A, m/s^5; null chooses the one that covers the displacement exactly")
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
    def line(self) -> MoveInSpace:
        """First move of a path to and fro."""
        unit = unit_of(np.array(self.direction), self.displacement_measure)[1]
        if self.amplitude_m_s5 is not None:
            given = BaseProfile(amplitude=self.amplitude_m_s5, period=self.period or _USUAL_PERIOD, holds=self.holds)
            return MoveInSpace(profiles=(given,), directions=unit[None])
        if self.displacement_m is None:
            raise SettingError("displacement_m", "is missing")
        return self.move(self.displacement_m * unit)

    def move(self, vector: Array) -> MoveInSpace:
        """Plan the move over a displacement in the world, m, not zero.

        `SettingError` names the key of the section `trajectory` where there is no smooth move under the limits.
        """
        length, direction = unit_of(vector, self.displacement_measure)
        if not self.limits.given:
            profile = covering(length, self.period or _USUAL_PERIOD, self.holds)
            return MoveInSpace(profiles=(profile,), directions=direction[None])
        if self.coordination == "straight-line":
            return checked_move((plan_move(length, self.limits.along(direction), self.period),), direction[None])
        axes = np.flatnonzero(vector)
        moves = synchronised(vector[axes], self.limits.of_axes(axes), self.period)
        return checked_move(moves, np.eye(3)[axes])
