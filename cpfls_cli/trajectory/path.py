"""The training path: moves back and forth along a line while the vehicle turns in yaw."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError
from cpfls_cli.trajectory.attitude import flat_attitude
from cpfls_cli.trajectory.profile import BaseProfile, Holds, covering
from cpfls_cli.trajectory.settings import TrajectorySettings


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """A planned motion, sampled; time is the first axis.

    Attributes
    ----------
    time : array, shape (time,), s
    position, velocity, acceleration, jerk, snap, crackle, pop : array, shape (time, 3), m and s
        World frame, z up; the path starts at the origin.
    yaw, yaw_rate, yaw_acceleration : array, shape (time,), rad and s
        Not wrapped.
    attitude, attitude_rate, attitude_acceleration : array, shape (time, 3), rad and s
        Roll, pitch, yaw.
    body_rate : array, shape (time, 3), rad/s, body frame
    maxima : dict
        Largest absolute value of each derivative of a move, by name, in the displacement measure of the
        settings, in m and s; from the closed form, not from the samples.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    snap: Array
    crackle: Array
    pop: Array
    yaw: Array
    yaw_rate: Array
    yaw_acceleration: Array
    attitude: Array
    attitude_rate: Array
    attitude_acceleration: Array
    body_rate: Array
    maxima: dict[str, float]


def plan(settings: TrajectorySettings, gravity: float) -> Trajectory:
    """Plan the training path.

    Parameters
    ----------
    settings : TrajectorySettings
    gravity : float, m/s^2

    Returns
    -------
    Trajectory

    Raises
    ------
    ComputationError
        If the path asks for free fall, where the attitude is not defined, or is too large for numbers to hold.

    References
    ----------
    Sections 7 and 9 of the paper; method.md section 3.
    """
    # What overflows is told from what does not at the end, with a remedy.
    with np.errstate(over="ignore", invalid="ignore"):
        planned = _planned(settings, gravity)
    if not all(np.isfinite(values).all() for values in vars(planned).values() if isinstance(values, np.ndarray)):
        raise ComputationError(
            "the attitude's derivatives are too large for numbers to hold; lower trajectory.yaw_turn_rad"
        )
    return planned


def _planned(settings: TrajectorySettings, gravity: float) -> Trajectory:
    time = _sample_times(settings)
    motion = _back_and_forth(settings, time)[..., None] * _direction(settings)
    heading = _heading(settings, time)
    flat = flat_attitude(time, motion[2:5], heading, gravity)
    position, velocity, acceleration, jerk, snap, crackle, pop = motion
    return Trajectory(
        time=time,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        jerk=jerk,
        snap=snap,
        crackle=crackle,
        pop=pop,
        yaw=heading[0],
        yaw_rate=heading[1],
        yaw_acceleration=heading[2],
        attitude=flat.attitude,
        attitude_rate=flat.attitude_rate,
        attitude_acceleration=flat.attitude_acceleration,
        body_rate=rotations.body_rate(flat.attitude, flat.attitude_rate),
        maxima=asdict(settings.move.peaks),
    )


def _sample_times(settings: TrajectorySettings) -> Array:
    # A duration of 0.7 s holds 7 steps of 0.1 s although the quotient is below 7 by rounding.
    steps = int(settings.duration_s / settings.sample_time_s + 1e-6)
    time: Array = np.arange(steps + 1, dtype=np.float64) * settings.sample_time_s
    return time


def _direction(settings: TrajectorySettings) -> Array:
    """World vector that one metre of displacement, in the chosen measure, moves along."""
    direction = np.array(settings.direction)
    per_axis = settings.displacement_measure == "per-axis"
    length = np.abs(direction).max() if per_axis else np.sqrt(direction @ direction)
    unit: Array = direction / length
    return unit


def _back_and_forth(settings: TrajectorySettings, time: Array) -> Array:
    """Displacement and its six derivatives, shape (7, time): the sum of all moves, each at rest outside its time."""
    move, legs = settings.move, settings.legs
    pause = (settings.duration_s - legs * move.duration) / max(legs - 1, 1)
    starts = np.arange(legs) * (move.duration + pause)
    motion = np.zeros((7, len(time)))
    for leg, start in enumerate(starts):
        motion += (-1.0) ** leg * move.sample(time - start).T
    return motion


def _heading(settings: TrajectorySettings, time: Array) -> Array:
    """Yaw, its rate and its acceleration, shape (3, time)."""
    if settings.yaw_profile == "uniform":
        rate = settings.yaw_turn_rad / settings.duration_s
        return np.stack([rate * time, np.full_like(time, rate), np.zeros_like(time)])
    stretched = _stretched(settings.move, settings.duration_s)
    heading: Array = settings.yaw_turn_rad * stretched.sample(time).T[:3]
    return heading


def _stretched(move: BaseProfile, duration: float) -> BaseProfile:
    """Profile of the same shape that covers 1 in the given duration."""
    factor = duration / move.duration
    holds = Holds(**{name: factor * hold for name, hold in asdict(move.holds).items()})
    return covering(1.0, factor * move.period, holds)
