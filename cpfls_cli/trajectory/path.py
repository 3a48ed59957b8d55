"""Plan a path in space: moves from rest to rest while the vehicle turns in yaw."""

from __future__ import annotations

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError
from cpfls_cli.trajectory.attitude import flat_attitude
from cpfls_cli.trajectory.clock import sample_times
from cpfls_cli.trajectory.heading import heading_of_legs, stretched_heading, uniform_heading
from cpfls_cli.trajectory.itinerary import duration_of, itinerary, maxima
from cpfls_cli.trajectory.legs import Leg, along
from cpfls_cli.trajectory.planned import Trajectory
from cpfls_cli.trajectory.settings import TrajectorySettings


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
    legs = itinerary(settings)
    duration = duration_of(settings, legs)
    time = sample_times(duration, settings.sample_time_s)
    motion = along(legs, time)
    heading = _heading(settings, legs, time, duration)
    flat = flat_attitude(time, motion[2:5], heading, gravity)
    position, velocity, acceleration, jerk, snap, crackle, pop = motion
    return Trajectory(
        duration=duration,
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
        legs=legs,
        maxima=maxima(legs),
    )


def _heading(settings: TrajectorySettings, legs: tuple[Leg, ...], time: Array, duration: float) -> Array:
    """Yaw, its rate and its acceleration, shape (3, time)."""
    if legs[0].yaw is not None:
        return heading_of_legs(time, legs)
    if settings.yaw_profile == "uniform":
        return uniform_heading(time, settings.yaw_turn, duration)
    return stretched_heading(time, settings.yaw_turn, legs[0].profiles[0], duration)
