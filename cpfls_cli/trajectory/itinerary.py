"""The legs of a path: where each begins, how it moves, and when."""

from __future__ import annotations

from dataclasses import asdict
from itertools import pairwise

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.clock import check_duration, check_samples
from cpfls_cli.trajectory.consistency import check_peaks
from cpfls_cli.trajectory.legs import Leg
from cpfls_cli.trajectory.settings import TrajectorySettings
from cpfls_cli.trajectory.shapes import Shape, shape_of
from cpfls_cli.trajectory.waypoint_settings import check_waypoints


def itinerary(settings: TrajectorySettings) -> tuple[Leg, ...]:
    """Plan the legs of a path in space.

    Returns
    -------
    tuple of Leg
        In the order of time.

    Raises
    ------
    SettingError
        If a leg cannot be planned, or the legs take longer than the duration; it names the key.
    """
    shapes = _between_waypoints(settings) if settings.path == "waypoints" else _to_and_fro(settings)
    begins = _begins(settings, np.array([shape.duration for shape in shapes]))
    start, yaw = _start(settings)
    legs: list[Leg] = []
    for number, (shape, begin) in enumerate(zip(shapes, begins, strict=True)):
        heading = (yaw[number], yaw[number + 1]) if yaw is not None else None
        legs.append(Leg(begin=float(begin), start=start, yaw=heading, **vars(shape)))
        start = start + legs[-1].vector
    return tuple(legs)


def duration_of(settings: TrajectorySettings, legs: tuple[Leg, ...]) -> float:
    """Tell how long a path takes.

    Returns
    -------
    float, s
        Where the settings leave it to the moves, up to the first sample at which all is at rest.

    Raises
    ------
    SettingError
        If the sample time does not suit it.
    """
    if settings.duration_s is not None:
        return settings.duration_s
    duration = legs[-1].end + _last_pause(settings)
    check_samples(duration, settings.sample_time_s)
    steps = np.ceil(duration / settings.sample_time_s - 1e-6)
    return float(steps * settings.sample_time_s)


def _to_and_fro(settings: TrajectorySettings) -> list[Shape]:
    out = settings.line
    back = Shape(profiles=out.profiles, directions=-out.directions, limited_by=out.limited_by)
    return [back if leg % 2 else out for leg in range(settings.legs)]


def _between_waypoints(settings: TrajectorySettings) -> list[Shape]:
    check_waypoints(settings.waypoints, settings.duration_s is None)
    points = [np.array(waypoint.position_m) for waypoint in settings.waypoints]
    shapes = [shape_of(end - start, settings.timing) for start, end in pairwise(points)]
    for profile in (profile for shape in shapes for profile in shape.profiles):
        check_peaks(profile, "limits" if settings.limits.given else "period_s")
    return shapes


def _start(settings: TrajectorySettings) -> tuple[Array, list[float] | None]:
    """Position at the start, and the yaw at the ends of all legs where the points have one."""
    if settings.path != "waypoints":
        return np.zeros(3), None
    yaw = [waypoint.yaw_rad for waypoint in settings.waypoints if waypoint.yaw_rad is not None]
    return np.array(settings.waypoints[0].position_m), yaw or None


def _begins(settings: TrajectorySettings, durations: Array) -> Array:
    """When each leg begins."""
    if settings.duration_s is None:
        pauses = np.full(len(durations), settings.pause_s)
        pauses[0] = 0.0
        if settings.path == "waypoints":
            pauses += [waypoint.pause_s for waypoint in settings.waypoints[:-1]]
        return np.asarray(np.cumsum(durations + pauses) - durations)
    needed = float(durations.sum())
    check_duration(len(durations), needed, settings.duration_s)
    pause = (settings.duration_s - needed) / max(len(durations) - 1, 1)
    return np.asarray(np.cumsum(durations) - durations + pause * np.arange(len(durations)))


def _last_pause(settings: TrajectorySettings) -> float:
    return settings.waypoints[-1].pause_s if settings.path == "waypoints" else 0.0


def maxima(legs: tuple[Leg, ...]) -> dict[str, float]:
    """Find the largest peak of every derivative over all legs.

    Returns
    -------
    dict of str to float
        By name of the derivative, m and s; infinite for crackle and pop where nothing limits them.
    """
    peaks = [asdict(profile.peaks) for leg in legs for profile in leg.profiles]
    return {name: max(abs(peak[name]) for peak in peaks) for name in peaks[0]}
