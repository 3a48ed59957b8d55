"""Settings of the training path."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings
from cpfls_cli.trajectory.profile import BaseProfile, Holds, covering

_LARGEST_PEAK = 1e100
_LARGEST_SIZE = 1e9


@dataclass(frozen=True, kw_only=True)
class TrajectorySettings(Settings):
    """Describe a path of back-and-forth moves along one line, with a turn in yaw over the whole time."""

    path: Annotated[
        Literal["cube-diagonal", "straight"],
        Doc("line of the moves: cube-diagonal is (1, 1, 1), straight is along `direction`"),
    ] = "cube-diagonal"
    direction: Annotated[
        tuple[float, float, float],
        Doc("direction of a straight path, world frame with z up; any length but zero"),
    ] = (1.0, 1.0, 1.0)
    legs: Annotated[int, Ge(1), Doc("number of moves: out, back, out, ...")] = 3
    displacement_m: Annotated[
        float | None,
        Doc("displacement of a move, m; null when amplitude_m_s5 is given"),
    ] = 64.0
    displacement_measure: Annotated[
        Literal["along-path", "per-axis"],
        Doc("whether a move is measured along the path or on the axis that moves most"),
    ] = "along-path"
    amplitude_m_s5: Annotated[
        float | None,
        Doc("crackle amplitude A, m/s^5; null chooses the one that covers displacement_m exactly"),
    ] = None
    period_s: Annotated[float, Gt(0), Doc("period P of one sine wave of the pop, s")] = 1.0
    hold_snap_s: Annotated[float, Ge(0), Doc("hold of constant snap, s, 8 times a move")] = 0.0
    hold_jerk_s: Annotated[float, Ge(0), Doc("hold of constant jerk, s, 4 times a move")] = 0.0
    hold_acceleration_s: Annotated[float, Ge(0), Doc("hold of constant acceleration, s, twice a move")] = 0.0
    hold_velocity_s: Annotated[float, Ge(0), Doc("hold of constant velocity, s, once a move")] = 0.0
    duration_s: Annotated[
        float, Gt(0), Doc("duration, s; what the moves leave of it is rest, shared equally between the moves")
    ] = 54.86
    sample_time_s: Annotated[float, Gt(0), Doc("time between samples, s")] = 0.01
    yaw_turn_rad: Annotated[float, Doc("yaw turned over the whole duration, rad")] = 2 * math.pi
    yaw_profile: Annotated[
        Literal["base", "uniform"],
        Doc("base: yaw follows the move's profile, stretched, from rest to rest; uniform: constant rate"),
    ] = "base"

    def __post_init__(self) -> None:
        """Refuse combinations that do not describe a path.

        Raises
        ------
        SettingError
            If the direction, the size of a move, or the time it needs contradicts another setting.
        """
        self._check_direction()
        self._check_size()
        self._check_time()

    def _check_direction(self) -> None:
        if not any(self.direction):
            raise SettingError("direction", "has length zero; give at least one component that is not 0")
        if self.path == "cube-diagonal" and len(set(self.direction)) > 1:
            message = "a cube-diagonal moves along (1, 1, 1); use path: straight for another direction"
            raise SettingError("direction", message)

    def _check_size(self) -> None:
        given = {"displacement_m": self.displacement_m, "amplitude_m_s5": self.amplitude_m_s5}
        if (self.displacement_m is None) == (self.amplitude_m_s5 is None):
            message = "give either displacement_m or amplitude_m_s5, and set the other to null"
            raise SettingError("amplitude_m_s5", message)
        for key, value in given.items():
            if value is not None and value <= 0:
                raise SettingError(key, "must be greater than 0")
        self._check_peaks("displacement_m" if self.amplitude_m_s5 is None else "amplitude_m_s5")

    def _check_peaks(self, key: str) -> None:
        name, value = max(asdict(self.move.peaks).items(), key=lambda peak: peak[1])
        # The attitude multiplies up to three of them, and the largest number is 1.8e308.
        if not value < _LARGEST_PEAK:
            message = f"a move with period_s = {self.period_s:g} has {name} up to {value:.3g} in m and s: too large to"
            raise SettingError(key, f"{message} compute with; lower it, or raise period_s")

    def _check_time(self) -> None:
        needed = self.legs * self.move.duration
        if needed > self.duration_s * (1 + 1e-12):
            message = f"{self.legs} moves of {self.move.duration:g} s need {needed:g} s; raise it or lower legs"
            raise SettingError("duration_s", message)
        if self.duration_s > _LARGEST_SIZE * self.sample_time_s:
            raise SettingError("sample_time_s", f"makes more than {_LARGEST_SIZE:g} samples of duration_s; raise it")
        if self.sample_time_s > self.duration_s:
            raise SettingError("sample_time_s", "is longer than duration_s")

    @property
    def move(self) -> BaseProfile:
        """One move in the chosen displacement measure."""
        holds = Holds(
            snap=self.hold_snap_s,
            jerk=self.hold_jerk_s,
            acceleration=self.hold_acceleration_s,
            velocity=self.hold_velocity_s,
        )
        if self.amplitude_m_s5 is not None:
            return BaseProfile(amplitude=self.amplitude_m_s5, period=self.period_s, holds=holds)
        if self.displacement_m is None:
            raise SettingError("displacement_m", "is missing")
        return covering(self.displacement_m, self.period_s, holds)
