"""Plans: a path in space leg by leg, or the rotation of a vehicle that is held."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from itertools import pairwise

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError
from cpfls_cli.trajectory.attitude import along, heading_of_legs, rotation_samples, stretched_heading, uniform_heading
from cpfls_cli.trajectory.consistency import check_duration, check_peaks, check_samples, check_waypoints
from cpfls_cli.trajectory.legs import Leg, MoveInSpace, evaluate_legs, move_in_space
from cpfls_cli.trajectory.profile import Peaks
from cpfls_cli.trajectory.rotation import RotationPath
from cpfls_cli.trajectory.settings import TrajectorySettings

# By how much two intervals of a uniform plan differ by rounding, in parts of one.
_UNIFORM = 1e-6


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
    runs : tuple of (float, float), s
        When each run of a path that is repeated begins and ends; empty where it is flown once.
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
    runs: tuple[tuple[float, float], ...]


def plan(settings: TrajectorySettings, gravity: float) -> Trajectory:
    """Plan a path in space, one run of it and without what excites it.

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
        legs = _itinerary(settings)
        duration = _duration_of(settings, legs)
        time = sample_times(duration, settings.sample_time_s)
        heading = _heading(settings, legs, time, duration)
        flown = along(time, evaluate_legs(legs, time) if legs else np.zeros((7, len(time), 3)), heading, gravity)
        planned = Trajectory(duration=duration, legs=legs, maxima=_maxima(legs), runs=(), **flown)
    if not all(np.isfinite(values).all() for values in vars(planned).values() if isinstance(values, np.ndarray)):
        raise ComputationError(
            "the attitude's derivatives are too large for floating-point numbers; lower trajectory.yaw_turn_rad"
        )
    return planned


def _heading(settings: TrajectorySettings, legs: tuple[Leg, ...], time: Array, duration: float) -> Array:
    """Compute yaw, its rate and its acceleration, shape (3, time)."""
    if not legs:
        return uniform_heading(time, 0.0, duration)
    if legs[0].yaw is not None:
        return heading_of_legs(time, legs)
    if settings.yaw_profile == "uniform":
        return uniform_heading(time, settings.yaw_turn, duration)
    return stretched_heading(time, settings.yaw_turn, legs[0].profiles[0], duration)


def _itinerary(settings: TrajectorySettings) -> tuple[Leg, ...]:
    """Plan the legs of a path in space, in the order of time; none of one that hovers."""
    if settings.path == "hover":
        return ()
    start, yaw = np.zeros(3), []
    if settings.path == "waypoints":
        moves = _between_waypoints(settings)
        start = np.array(settings.waypoints[0].position_m)
        yaw = [waypoint.yaw_rad for waypoint in settings.waypoints if waypoint.yaw_rad is not None]
    else:
        out = settings.line
        back = replace(out, directions=-out.directions)
        moves = [back if leg % 2 else out for leg in range(settings.legs)]
    begins = _begins(settings, np.array([move.duration for move in moves]))
    legs: list[Leg] = []
    for number, (move, begin) in enumerate(zip(moves, begins, strict=True)):
        heading = (yaw[number], yaw[number + 1]) if yaw else None
        legs.append(Leg(begin=float(begin), start=start, yaw=heading, **vars(move)))
        start = start + legs[-1].vector
    return tuple(legs)


def _duration_of(settings: TrajectorySettings, legs: tuple[Leg, ...]) -> float:
    """Compute the duration of a path, s: as set, or up to the first sample at rest, which all runs then share."""
    if settings.duration_s is not None:
        duration = settings.duration_s
        if settings.repeat == 1:
            return duration
    else:
        duration = legs[-1].end + (settings.waypoints[-1].pause_s if settings.path == "waypoints" else 0.0)
        check_samples(duration, settings.sample_time_s)
    steps = np.ceil(duration / settings.sample_time_s - 1e-6)
    return float(steps * settings.sample_time_s)


def _between_waypoints(settings: TrajectorySettings) -> list[MoveInSpace]:
    check_waypoints(settings.waypoints, settings.duration_s is None)
    points = [np.array(waypoint.position_m) for waypoint in settings.waypoints]
    moves = [move_in_space(end - start, settings.timing) for start, end in pairwise(points)]
    for profile in (profile for move in moves for profile in move.profiles):
        check_peaks(profile, "limits" if settings.limits.given else "period_s")
    return moves


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


def _maxima(legs: tuple[Leg, ...]) -> dict[str, float]:
    """Find the largest peak of every derivative over all legs; infinite for crackle and pop without a limit."""
    peaks = [asdict(profile.peaks) for leg in legs for profile in leg.profiles]
    return {field.name: max((abs(peak[field.name]) for peak in peaks), default=0.0) for field in fields(Peaks)}


def held_rotation(path: RotationPath, sample_time: float) -> PlannedRotation:
    """Plan the rotation of a held vehicle along an attitude path.

    Parameters
    ----------
    sample_time : float, s
    """
    time = sample_times(path.duration, sample_time)
    motion = path.sample(time)
    planes = (motion.attitude, motion.attitude_rate, motion.attitude_acceleration)
    heading = np.stack([values[:, 2] for values in planes])
    return PlannedRotation(duration=path.duration, **rotation_samples(time, motion, heading))


def sample_interval(time: Array, what: str) -> float:
    """Find the time between the samples of a plan, s; words say what needs them to be uniform.

    Raises
    ------
    ComputationError
        If there are fewer than two samples, or they are not uniform.
    """
    if len(time) < 2 or np.ptp(np.diff(time)) > _UNIFORM * (time[1] - time[0]):
        raise ComputationError(f"{what} needs a trajectory with at least two samples at one rate")
    return float(time[-1] - time[0]) / (len(time) - 1)


def sample_times(duration: float, sample_time: float) -> Array:
    """Compute the sample times of a duration.

    Returns
    -------
    array, shape (time,), s
        From 0; the last one is not later than the duration.
    """
    # A duration of 0.7 s holds 7 steps of 0.1 s although the quotient is below 7 by rounding.
    steps = int(duration / sample_time + 1e-6)
    time: Array = np.arange(steps + 1, dtype=np.float64) * sample_time
    return time
