"""What a plan returns: a rotation, and for a path in space the translation too."""

from __future__ import annotations

from dataclasses import dataclass

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.legs import Leg


@dataclass(frozen=True, kw_only=True)
class PlannedRotation:
    """How a vehicle is to turn, sampled; time is the first axis.

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
