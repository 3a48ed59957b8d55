"""Attitude along a path in space: the yaw, and the roll and pitch that the acceleration requires."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError
from cpfls_cli.trajectory.legs import Leg, samples_of_legs
from cpfls_cli.trajectory.profile import BaseProfile, covering
from cpfls_cli.trajectory.rotation import RotationMotion

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
