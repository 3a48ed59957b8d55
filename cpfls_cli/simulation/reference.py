"""The planned motion between its samples, for an autopilot that runs faster."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from cpfls_cli import rotations
from cpfls_cli.arrays import Array


@dataclass(frozen=True)
class Reference:
    """What an autopilot follows; time is the first axis.

    Attributes
    ----------
    position, velocity, acceleration : array, shape (time, 3), m and s, world frame
    attitude : array, shape (time, 3), rad
    body_rate : array, shape (time, 3), rad/s, body frame
    body_acceleration : array, shape (time, 3), rad/s^2, body frame
    """

    position: Array
    velocity: Array
    acceleration: Array
    attitude: Array
    body_rate: Array
    body_acceleration: Array


def reference(planned: Mapping[str, Array], time: Array, at: Array) -> Reference:
    """Interpolate a planned motion by cubic splines.

    Parameters
    ----------
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, `position`, `velocity`, `acceleration`, shape
        (time, 3) each.
    time : array, shape (time,), s
    at : array, shape (step,), s
        Times asked for.

    Returns
    -------
    Reference
        Of shape (step, 3) each.
    """
    names = ("position", "velocity", "acceleration", "attitude", "attitude_rate", "attitude_acceleration")
    splines = CubicSpline(time, np.stack([planned[name] for name in names], axis=1))
    position, velocity, acceleration, q, qd, qdd = np.moveaxis(splines(at), 1, 0)
    return Reference(
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        attitude=q,
        body_rate=rotations.body_rate(q, qd),
        body_acceleration=rotations.body_acceleration(q, qd, qdd),
    )
