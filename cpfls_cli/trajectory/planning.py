"""Plans: a path in space leg by leg with its attitude and repeats, or the rotation of a vehicle that is held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from itertools import pairwise
from math import ceil, sqrt, tau

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError
from cpfls_cli.trajectory.legs import Leg, MoveInSpace, evaluate_legs, samples_of_legs
from cpfls_cli.trajectory.profile import BaseProfile, Peaks, covering
from cpfls_cli.trajectory.rotation import RotationMotion, RotationPath
from cpfls_cli.trajectory.settings import (
    TrajectorySettings,
    check_duration,
    check_peaks,
    check_samples,
    check_waypoints,
)

# Fraction of gravity below which the direction of the thrust is rounding error.
_NO_THRUST = 1e-9


MOTION = ("position", "velocity", "acceleration", "jerk", "snap", "crackle", "pop")
"""Names of a path in space and its derivatives in a `Trajectory`."""


def along(time: Array, motion: Array, heading: Array, gravity: float) -> dict[str, Array]:
    """Arrange the samples of a path in space and the attitude that flies it, by their names in a `Trajectory`.

    Parameters
    ----------
    time : array, shape (time,), s
    motion : array, shape (7, time, 3), m and s, world frame
        Position and its derivatives up to the pop.
    heading : array, shape (3, time), rad and s
        Yaw, its rate and its acceleration.
    gravity : float, m/s^2

    Raises
    ------
    ComputationError
        If the path asks for free fall, where the attitude is not defined.
    """
    flat = flat_attitude(time, motion[2:5], heading, gravity)
    return dict(zip(MOTION, motion, strict=True)) | rotation_samples(time, flat, heading)


def rotation_samples(time: Array, motion: RotationMotion, heading: Array) -> dict[str, Array]:
    """Arrange the samples of a rotation by their names in a `PlannedRotation`; heading as of `uniform_heading`."""
    return {
        "time": time,
        "yaw": heading[0],
        "yaw_rate": heading[1],
        "yaw_acceleration": heading[2],
        **vars(motion),
        "body_rate": rotations.body_rate(motion.attitude, motion.attitude_rate),
    }


def flat_attitude(time: Array, translation: Array, heading: Array, gravity: float) -> RotationMotion:
    """Derive roll and pitch from acceleration and yaw, and their derivatives from jerk and snap.

    ``phi = asin((ax sin psi - ay cos psi) / |f|)``, ``theta = atan2(ax cos psi + ay sin psi, az + g)`` with ``f = a + g
    e3``: equation (18) in its physical form, method.md section 3. `translation`: acceleration, jerk and snap in the
    world frame, z up, shape (3, time, 3), m and s; `heading`: yaw and two derivatives, shape (3, time), rad and s.
    `ComputationError` where the thrust vanishes, reverses between two samples, or points where the pitch is undefined.
    """
    force = translation + np.array([[[0.0, 0.0, gravity]], [[0.0] * 3], [[0.0] * 3]])
    _refuse_free_fall(time, force[0], gravity)
    forward, right, up = _in_heading_frame(force, heading)
    tilted = _length(forward, up)
    _refuse_sideways(time, tilted[0], gravity)
    attitude, rate, acceleration = np.stack([_angle(right, tilted), _angle(forward, up), heading], axis=2)
    return RotationMotion(attitude, rate, acceleration)


def _in_heading_frame(force: Array, heading: Array) -> tuple[Array, Array, Array]:
    """Resolve the force into forward, right and up in the frame that turns with yaw, each (3, time)."""
    yaw, rate, acceleration = heading
    sine, cosine = np.sin(yaw), np.cos(yaw)
    x, y, up = np.moveaxis(force, 2, 0)
    forward, right = x * cosine + y * sine, x * sine - y * cosine
    forward_rate = forward[1] - rate * right[0]
    right_rate = right[1] + rate * forward[0]
    forward_acceleration = forward[2] - rate * (right[1] + right_rate) - acceleration * right[0]
    right_acceleration = right[2] + rate * (forward[1] + forward_rate) + acceleration * forward[0]
    turned_forward = np.stack([forward[0], forward_rate, forward_acceleration])
    return turned_forward, np.stack([right[0], right_rate, right_acceleration]), up


def _length(x: Array, y: Array) -> Array:
    """Length of (x, y) and its two time derivatives; rows are derivatives."""
    length = np.hypot(x[0], y[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = (x[0] * x[1] + y[0] * y[1]) / length
        second = (x[1] ** 2 + x[0] * x[2] + y[1] ** 2 + y[0] * y[2] - rate**2) / length
    return np.stack([length, rate, second])


def _angle(opposite: Array, adjacent: Array) -> Array:
    """Angle ``atan2(opposite, adjacent)`` and its two time derivatives; rows are derivatives."""
    square = opposite[0] ** 2 + adjacent[0] ** 2
    square_rate = 2 * (opposite[0] * opposite[1] + adjacent[0] * adjacent[1])
    rate = (adjacent[0] * opposite[1] - opposite[0] * adjacent[1]) / square
    second = (adjacent[0] * opposite[2] - opposite[0] * adjacent[2] - rate * square_rate) / square
    return np.stack([np.arctan2(opposite[0], adjacent[0]), rate, second])


def _refuse_free_fall(time: Array, force: Array, gravity: float) -> None:
    weightless = np.linalg.norm(force, axis=1) <= _NO_THRUST * gravity
    weightless[1:] |= np.einsum("ni,ni->n", force[1:], force[:-1]) <= 0
    if weightless.any():
        raise ComputationError(
            f"free fall at t = {time[weightless.argmax()]:g} s: the thrust vanishes or turns by 90 degrees or "
            "more within one sample, so the attitude is undefined; lower the acceleration of the path"
        )


def _refuse_sideways(time: Array, tilted: Array, gravity: float) -> None:
    sideways = tilted <= _NO_THRUST * gravity
    if sideways.any():
        raise ComputationError(
            f"roll of 90 degrees at t = {time[sideways.argmax()]:g} s: pitch is undefined there; change "
            "the acceleration of the path or the yaw"
        )


def uniform_heading(time: Array, turn: float, duration: float) -> Array:
    """Compute a yaw that turns at a constant rate, with its rate and acceleration, shape (3, time), rad and s."""
    rate = turn / duration
    return np.stack([rate * time, np.full_like(time, rate), np.zeros_like(time)])


def stretched_heading(time: Array, turn: float, profile: BaseProfile, duration: float) -> Array:
    """Compute a yaw that turns from rest to rest with the shape of a move, stretched in time, as `uniform_heading`."""
    unit = covering(1.0, profile.period, profile.holds).stretched(duration)
    return np.asarray(turn * unit.sample(time).T[:3])


def heading_of_legs(time: Array, legs: Sequence[Leg]) -> Array:
    """Compute a yaw that turns from point to point during the legs, which have one each, as `uniform_heading`."""
    heading = np.zeros((3, len(time)))
    heading[0] = _yaw(legs[0])[0]
    for leg, samples in samples_of_legs(legs, time):
        begin, end = _yaw(leg)
        turned = stretched_heading(time[samples] - leg.begin, end - begin, leg.profiles[0], leg.duration)
        heading[:, samples] = turned
        heading[0, samples] += begin
    return heading


def _yaw(leg: Leg) -> tuple[float, float]:
    assert leg.yaw is not None
    return leg.yaw


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
        # Crackle and pop are infinite without a limit.
        peaks = [asdict(profile.peaks) for leg in legs for profile in leg.profiles]
        maxima = {each.name: max((abs(peak[each.name]) for peak in peaks), default=0.0) for each in fields(Peaks)}
        planned = Trajectory(duration=duration, legs=legs, maxima=maxima, runs=(), **flown)
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
    moves = [settings.move(end - start) for start, end in pairwise(points)]
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


def sample_interval(time: Array) -> float:
    """Find the time between the samples of a plan that is flown in closed loop, s.

    ComputationError if there are fewer than two samples, or they are not uniform.
    """
    if len(time) < 2 or np.ptp(np.diff(time)) > _UNIFORM * (time[1] - time[0]):
        raise ComputationError("a flight in closed loop needs a trajectory with at least two samples at one rate")
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


_AT_HOME = 1e-6
"""Distance in m, and angle in rad, at which a path ends where it begins."""

_TURN = BaseProfile(amplitude=1.0, period=1.0)
"""Shape of a turn back in yaw."""


def repeated(run: Trajectory, settings: TrajectorySettings, gravity: float) -> Trajectory:
    """Fly a path `settings.repeat` times, with a straight way back and a pause before each further run.

    Parameters
    ----------
    run : Trajectory
        At rest at its last sample.
    gravity : float, m/s^2

    Returns
    -------
    Trajectory
        Runs are equal sample by sample, but for whole turns of yaw, by which it goes on.

    Raises
    ------
    SettingError
        If the way back cannot be planned, or there are more samples than memory holds; it names the key.
    """
    count, step = settings.repeat, float(run.time[1])
    if count == 1:
        return run
    back, turn = _way_back(run, settings)
    rest = max(0.0 if back is None else back.duration, _turning_time(run, turn)) + settings.repeat_pause_s
    between = max(ceil(rest / step - 1e-6), 1)
    lap = len(run.time) - 1 + between
    check_samples((count * lap + 1) * step, step)
    resting = _between(run, back, turn, step * np.arange(1, between, dtype=np.float64), gravity)
    begins = [number * lap * step for number in range(count)]
    whole = tau * round((float(run.yaw[-1] - run.yaw[0]) - turn) / tau)
    signals = {
        name: np.concatenate([*[values, resting[name]] * (count - 1), values])
        for name, values in vars(run).items()
        if isinstance(values, np.ndarray) and name != "time"
    }
    turned = whole * np.minimum(np.arange(len(signals["yaw"])) // lap, count - 1)
    signals["yaw"] = signals["yaw"] + turned
    signals["attitude"] = signals["attitude"] + turned[:, None] * np.array([0.0, 0.0, 1.0])
    return Trajectory(
        **signals,
        time=step * np.arange(len(turned), dtype=np.float64),
        duration=begins[-1] + run.duration,
        legs=_all_legs(run, back, begins),
        maxima=run.maxima,
        runs=tuple((begin, begin + float(run.time[-1])) for begin in begins),
    )


def _way_back(run: Trajectory, settings: TrajectorySettings) -> tuple[Leg | None, float]:
    """Plan the move back to the start, None where the path ends there, and the turn left over whole ones, rad."""
    turned = float(run.yaw[-1] - run.yaw[0])
    turn = turned - tau * round(turned / tau)
    vector = run.position[0] - run.position[-1]
    if float(np.abs(vector).max()) <= _AT_HOME:
        return None, turn if abs(turn) > _AT_HOME else 0.0
    move = settings.move(vector)
    return Leg(begin=0.0, start=run.position[-1], yaw=None, **vars(move)), turn


def _turning_time(run: Trajectory, turn: float) -> float:
    """Time for a turn back in yaw, s, that accelerates no more than the run does itself."""
    if not turn:
        return 0.0
    unit = stretched_heading(np.linspace(0.0, 1.0, 200), 1.0, _TURN, 1.0)
    return sqrt(abs(turn) * float(np.abs(unit[2]).max() / np.abs(run.yaw_acceleration).max()))


def _between(run: Trajectory, back: Leg | None, turn: float, time: Array, gravity: float) -> dict[str, Array]:
    """Sample what lies between two runs, at times since the end of the first."""
    motion = np.zeros((7, len(time), 3))
    motion[0] = run.position[-1]
    if back is not None:
        motion = evaluate_legs((back,), time)
    heading = np.zeros((3, len(time)))
    if turn:
        taken = max(_turning_time(run, turn), 0.0 if back is None else back.duration)
        heading = stretched_heading(time, -turn, _TURN, taken)
    heading[0] += run.yaw[-1]
    return along(time, motion, heading, gravity)


def _all_legs(run: Trajectory, back: Leg | None, begins: list[float]) -> tuple[Leg, ...]:
    """List the moves of all runs and the ways back between them, in the order of time."""
    home = float(run.time[-1])
    legs = [
        replace(leg, begin=begin + leg.begin)
        for begin in begins
        for leg in (*run.legs, *(() if back is None else (replace(back, begin=home),)))
    ]
    return tuple(legs if back is None else legs[:-1])
