"""Rules between the settings of a path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import TYPE_CHECKING

from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory.profile import BaseProfile

if TYPE_CHECKING:
    from cpfls_cli.trajectory.settings import ExciteSettings, TrajectorySettings, WaypointSettings

_LARGEST_PEAK = 1e100
# Of the fastest wave of an excitation, between which an autopilot and a simulation interpolate.
_SAMPLES_IN_A_PERIOD = 10
_MAY_JUMP = ("crackle", "pop")
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
        raise SettingError(
            "pause_s", "contradicts duration_s, which determines the rest between moves; set duration_s to null"
        )


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
            message = "contradicts duration_s, which determines the rest between moves; set duration_s to null"
            raise SettingError(f"waypoints.{number}.pause_s", message)
