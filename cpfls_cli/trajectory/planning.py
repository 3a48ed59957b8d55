"""Plans: a path in space leg by leg, or the rotation of a vehicle that is held."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import pairwise

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError
from cpfls_cli.trajectory.attitude import along, heading_of_legs, stretched_heading, uniform_heading
from cpfls_cli.trajectory.consistency import check_duration, check_peaks, check_samples, check_waypoints
from cpfls_cli.trajectory.legs import Leg, Shape, evaluate_legs, shape_of
from cpfls_cli.trajectory.rotation import RotationPath
from cpfls_cli.trajectory.settings import TrajectorySettings


@dataclass(frozen=True, kw_only=True)
class PlannedRotation:
    """Planned rotation of a vehicle, sampled; time is the first axis.

    By itself it is the plan of a vehicle that is held at its centre of mass.

    Attributes
    ----------
    duration : float, s
        Of the path; the last sample is not later.
    time : array, shape (time,), s
    yaw, yaw_rate, yaw_acceleration : array, shape (time,), rad and s
        Not wrapped.
    attitude, attitude_rate, attitude_acceleration : array, shape (time, 3), rad and s
        Roll, pitch, yaw.
    body_rate : array, shape (time, 3), rad/s, body frame
    """

    duration: float
    time: Array
    yaw: Array
    yaw_rate: Array
    yaw_acceleration: Array
    attitude: Array
    attitude_rate: Array
    attitude_acceleration: Array
    body_rate: Array


@dataclass(frozen=True, kw_only=True)
class Trajectory(PlannedRotation):
    """A planned motion in space, sampled; time is the first axis.

    Attributes
    ----------
    position, velocity, acceleration, jerk, snap, crackle, pop : array, shape (time, 3), m and s
        World frame, z up.
    legs : tuple of Leg
        The rest-to-rest moves that it is made of.
    maxima : dict
        Largest absolute value of each derivative of any move, by name, in the displacement measure of the
        settings, in m and s; from the closed form, not from the samples.
    """

    position: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    snap: Array
    crackle: Array
    pop: Array
    legs: tuple[Leg, ...]
    maxima: dict[str, float]


def plan(settings: TrajectorySettings, gravity: float) -> Trajectory:
    """Plan a path in space.

    Parameters
    ----------
    settings : TrajectorySettings
        Of a path that is not held.
    gravity : float, m/s^2

    Raises
    ------
    SettingError
        If a move cannot be planned, or the moves take longer than the duration; it names the key.
    ComputationError
        If the path asks for free fall, where the attitude is not defined, or its derivatives overflow.

    References
    ----------
    Sections 7 and 9 of the paper; method.md section 3.
    """
    # Overflow is reported at the end, with a remedy.
    with np.errstate(over="ignore", invalid="ignore"):
        planned = _planned(settings, gravity)
    if not all(np.isfinite(values).all() for values in vars(planned).values() if isinstance(values, np.ndarray)):
        raise ComputationError(
            "the attitude's derivatives are too large for numbers to hold; lower trajectory.yaw_turn_rad"
        )
    return planned


def _planned(settings: TrajectorySettings, gravity: float) -> Trajectory:
    legs = _itinerary(settings)
    duration = _duration_of(settings, legs)
    time = sample_times(duration, settings.sample_time_s)
    motion = evaluate_legs(legs, time)
    flown = along(time, motion, _heading(settings, legs, time, duration), gravity)
    return Trajectory(duration=duration, legs=legs, maxima=_maxima(legs), **flown)


def _heading(settings: TrajectorySettings, legs: tuple[Leg, ...], time: Array, duration: float) -> Array:
    """Compute yaw, its rate and its acceleration, shape (3, time)."""
    if legs[0].yaw is not None:
        return heading_of_legs(time, legs)
    if settings.yaw_profile == "uniform":
        return uniform_heading(time, settings.yaw_turn, duration)
    return stretched_heading(time, settings.yaw_turn, legs[0].profiles[0], duration)


def _itinerary(settings: TrajectorySettings) -> tuple[Leg, ...]:
    """Plan the legs of a path in space, in the order of time."""
    shapes = _between_waypoints(settings) if settings.path == "waypoints" else _to_and_fro(settings)
    begins = _begins(settings, np.array([shape.duration for shape in shapes]))
    start, yaw = _start(settings)
    legs: list[Leg] = []
    for number, (shape, begin) in enumerate(zip(shapes, begins, strict=True)):
        heading = (yaw[number], yaw[number + 1]) if yaw is not None else None
        legs.append(Leg(begin=float(begin), start=start, yaw=heading, **vars(shape)))
        start = start + legs[-1].vector
    return tuple(legs)


def _duration_of(settings: TrajectorySettings, legs: tuple[Leg, ...]) -> float:
    """Compute the duration of a path, s: as set, or up to the first sample at which all is at rest."""
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
    """Find the start position, and the yaw at the ends of all legs where the points have one."""
    if settings.path != "waypoints":
        return np.zeros(3), None
    yaw = [waypoint.yaw_rad for waypoint in settings.waypoints if waypoint.yaw_rad is not None]
    return np.array(settings.waypoints[0].position_m), yaw or None


def _begins(settings: TrajectorySettings, durations: Array) -> Array:
    """Compute the time at which each leg begins."""
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


def _maxima(legs: tuple[Leg, ...]) -> dict[str, float]:
    """Find the largest peak of every derivative over all legs; infinite for crackle and pop without a limit."""
    peaks = [asdict(profile.peaks) for leg in legs for profile in leg.profiles]
    return {name: max(abs(peak[name]) for peak in peaks) for name in peaks[0]}


def held_rotation(path: RotationPath, sample_time: float) -> PlannedRotation:
    """Plan the rotation of a held vehicle along an attitude path.

    Parameters
    ----------
    sample_time : float, s
    """
    time = sample_times(path.duration, sample_time)
    motion = path.sample(time)
    planes = (motion.attitude, motion.attitude_rate, motion.attitude_acceleration)
    yaw, yaw_rate, yaw_acceleration = (np.ascontiguousarray(values[:, 2]) for values in planes)
    return PlannedRotation(
        duration=path.duration,
        time=time,
        yaw=yaw,
        yaw_rate=yaw_rate,
        yaw_acceleration=yaw_acceleration,
        attitude=motion.attitude,
        attitude_rate=motion.attitude_rate,
        attitude_acceleration=motion.attitude_acceleration,
        body_rate=rotations.body_rate(motion.attitude, motion.attitude_rate),
    )


def sample_times(duration: float, sample_time: float) -> Array:
    """Compute the sample times of a duration.

    Parameters
    ----------
    duration : float, s
    sample_time : float, s

    Returns
    -------
    array, shape (time,), s
        From 0; the last one is not later than the duration.
    """
    # A duration of 0.7 s holds 7 steps of 0.1 s although the quotient is below 7 by rounding.
    steps = int(duration / sample_time + 1e-6)
    time: Array = np.arange(steps + 1, dtype=np.float64) * sample_time
    return time
