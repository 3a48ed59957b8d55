"""Settings of the planned path."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings
from cpfls_cli.trajectory.clock import check_duration, check_samples
from cpfls_cli.trajectory.limit_settings import LimitSettings
from cpfls_cli.trajectory.profile import BaseProfile, Holds
from cpfls_cli.trajectory.rotation_settings import RotationSettings
from cpfls_cli.trajectory.shapes import Shape, Timing, shape_of, unit_of
from cpfls_cli.trajectory.waypoint_settings import WaypointSettings, check_waypoints

PathKind = Literal["cube-diagonal", "straight", "waypoints", "full-rotation", "optimised"]

_LARGEST_PEAK = 1e100
_USUAL_PERIOD = 1.0
_MAY_JUMP = ("crackle", "pop")
_ROTATIONS = ("full-rotation", "optimised")


@dataclass(frozen=True, kw_only=True)
class TrajectorySettings(Settings):
    """Describe a path of rest-to-rest moves in space, or full rotations of a vehicle that is held."""

    path: Annotated[
        PathKind,
        Doc(
            "cube-diagonal: to and fro along (1, 1, 1); straight: along `direction`; waypoints: from point to point; "
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
            "and fro, none through waypoints"
        ),
    ] = None
    yaw_profile: Annotated[
        Literal["base", "uniform"],
        Doc("base: yaw follows the first move's profile, stretched, from rest to rest; uniform: constant rate"),
    ] = "base"
    rotation: Annotated[RotationSettings, Doc("for paths full-rotation and optimised")] = field(
        default_factory=RotationSettings
    )
    tilt_max_rad: Annotated[
        Annotated[float, Gt(0), Le(math.pi)] | None, Doc("largest tilt of a path in space, rad; null: any")
    ] = None
    infeasible: Annotated[
        Literal["stop", "report"],
        Doc("thrust, tilt or a rotor asked for more than the vehicle has: stop, or write the path and say so"),
    ] = "stop"

    def __post_init__(self) -> None:
        """Refuse combinations that do not describe a path.

        Raises
        ------
        SettingError
            If the direction, the size of a move, its limits or the time it needs contradicts another setting.
        """
        self._check_clock()
        if self.held:
            self._check_held()
            return
        self._check_direction()
        self._check_limits()
        if self.path == "waypoints":
            # None at all may still come with a file.
            if self.waypoints:
                check_waypoints(self.waypoints, self.duration_s is None)
            return
        self._check_size()
        self._check_moves()

    @property
    def held(self) -> bool:
        """Whether the vehicle is held at its centre of mass and only turns."""
        return self.path in _ROTATIONS

    @property
    def yaw_turn(self) -> float:
        """Yaw turned over the whole duration, rad."""
        if self.yaw_turn_rad is not None:
            return self.yaw_turn_rad
        return 0.0 if self.path == "waypoints" else 2 * math.pi

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
        """How long a move takes."""
        return Timing(
            limits=self.limits,
            coordination=self.coordination,
            period=self.period,
            holds=self.holds,
            measure=self.displacement_measure,
        )

    @property
    def line(self) -> Shape:
        """Shape of the first move of a path to and fro."""
        unit = unit_of(np.array(self.direction), self.displacement_measure)[1]
        if self.amplitude_m_s5 is not None:
            given = BaseProfile(amplitude=self.amplitude_m_s5, period=self.period or _USUAL_PERIOD, holds=self.holds)
            return Shape(profiles=(given,), directions=unit[None])
        if self.displacement_m is None:
            raise SettingError("displacement_m", "is missing")
        return shape_of(self.displacement_m * unit, self.timing)

    def _check_clock(self) -> None:
        if self.duration_s is None:
            if self.held:
                raise SettingError("duration_s", f"is null; path {self.path} needs a duration")
            return
        check_samples(self.duration_s, self.sample_time_s)
        if self.pause_s:
            raise SettingError("pause_s", "contradicts duration_s, which leaves what rest there is; set that to null")

    def _check_held(self) -> None:
        if self.limits.given:
            raise SettingError("limits", f"hold for moves in space; path {self.path} has those of the key rotation")
        if self.tilt_max_rad is not None:
            raise SettingError("tilt_max_rad", f"holds for paths in space; path {self.path} turns all the way round")

    def _check_direction(self) -> None:
        if not any(self.direction):
            raise SettingError("direction", "has length zero; give at least one component that is not 0")
        if self.path == "cube-diagonal" and len(set(self.direction)) > 1:
            message = "a cube-diagonal moves along (1, 1, 1); use path: straight for another direction"
            raise SettingError("direction", message)

    def _check_limits(self) -> None:
        if not self.limits.given:
            if self.coordination == "each-axis":
                raise SettingError("coordination", "each-axis plans under limits; give some, or use straight-line")
            return
        given = [key for key, value in asdict(self.holds).items() if value]
        if given:
            raise SettingError(f"hold_{given[0]}_s", "contradicts limits, which choose the holds; set it to 0")
        if self.amplitude_m_s5 is not None:
            raise SettingError("amplitude_m_s5", "contradicts limits, which choose it; set it to null")
        if self.coordination == "each-axis" and self.displacement_measure == "along-path":
            message = "along-path has no meaning where every axis is planned by itself; use per-axis"
            raise SettingError("displacement_measure", message)

    def _check_size(self) -> None:
        given = {"displacement_m": self.displacement_m, "amplitude_m_s5": self.amplitude_m_s5}
        if (self.displacement_m is None) == (self.amplitude_m_s5 is None):
            message = "give either displacement_m or amplitude_m_s5, and set the other to null"
            raise SettingError("amplitude_m_s5", message)
        for key, value in given.items():
            if value is not None and value <= 0:
                raise SettingError(key, "must be greater than 0")

    def _check_moves(self) -> None:
        line = self.line
        for profile in line.profiles:
            self._check_peaks(profile, "displacement_m" if self.amplitude_m_s5 is None else "amplitude_m_s5")
        if self.duration_s is not None:
            check_duration(self.legs, self.legs * line.duration, self.duration_s)

    def _check_peaks(self, profile: BaseProfile, key: str) -> None:
        peaks = {name: value for name, value in asdict(profile.peaks).items() if name not in _MAY_JUMP}
        name, value = max(peaks.items(), key=lambda peak: peak[1])
        # The attitude multiplies up to three of them, and the largest number is 1.8e308.
        if not value < _LARGEST_PEAK:
            message = f"a move with period_s = {profile.period:g} has {name} up to {value:.3g} in m and s: too large to"
            raise SettingError(key, f"{message} compute with; lower it, or raise period_s")
