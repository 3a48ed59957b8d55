"""Why an axis is badly explained: a constant torque, no excitation, or something that is not inertia."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.rigid_body import vertical
from cpfls_cli.identification.data import TorqueData, TorqueSource, axis_scale
from cpfls_cli.identification.judge import Explained
from cpfls_cli.identification.least_squares import Triangle
from cpfls_cli.identification.rigid_columns import RIGID, rigid_columns
from cpfls_cli.rotations import body_acceleration, body_torque, euler_rate_matrix


@dataclass(frozen=True)
class AxisEvidence:
    """What a rigid body and a constant torque explain of each body axis.

    Attributes
    ----------
    constant : array, shape (3,), N m
        Constant body torque fitted beside the rigid body.
    r2 : array, shape (3,)
        Share of the body torque explained by both, at samples where the pitch is not vertical; NaN if there are none.
    torque : array, shape (3,), N m
        Root mean square of the body torque at these samples.
    acceleration : array, shape (3,), rad/s^2
        Root mean square of the derivative of the body rates.
    """

    constant: Array
    r2: Array
    torque: Array
    acceleration: Array


def axis_evidence(source: TorqueSource, rank_tolerance: float) -> AxisEvidence:
    """Fit six inertia parameters and a constant body torque."""
    scale = 1.0 / axis_scale(source)
    rows = ((_columns(data) * scale[:, None], data.torque * scale) for data in source.chunks())
    triangle = Triangle.of((columns.reshape(-1, columns.shape[2]), torque.reshape(-1)) for columns, torque in rows)
    parameters = triangle.solve(rank_tolerance).coefficients
    explained, count, torque, acceleration = Explained(), 0, np.zeros(3), np.zeros(3)
    for data in source.chunks():
        motion, told = data.motion, ~vertical(data.motion.attitude)
        by_both = _columns(data) @ parameters
        measured, found = (body_torque(motion.attitude[told], values[told]) for values in (data.torque, by_both))
        explained.add(measured, measured - found)
        count, torque = count + len(measured), torque + np.sum(measured**2, axis=0)
        acceleration += np.sum(body_acceleration(motion.attitude, motion.rate, motion.acceleration) ** 2, axis=0)
    size = np.sqrt([torque / max(count, 1), acceleration / len(source)])
    return AxisEvidence(parameters[RIGID:], explained.r2, size[0], size[1])


def _columns(data: TorqueData) -> Array:
    """Columns of six inertia parameters and three constant body torques, shape (samples, 3, 9)."""
    constant = euler_rate_matrix(data.motion.attitude).swapaxes(1, 2)
    return np.concatenate([rigid_columns(data.motion), constant], axis=2)
