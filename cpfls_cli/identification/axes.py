"""Why an axis is badly explained: a constant torque, no excitation, or something that is not inertia."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.data import TorqueData, axis_scale
from cpfls_cli.identification.judge import r_squared
from cpfls_cli.identification.least_squares import solve
from cpfls_cli.identification.rigid_base import rigid_columns
from cpfls_cli.rotations import body_acceleration, body_torque, euler_rate_matrix


@dataclass(frozen=True)
class AxisEvidence:
    """What a rigid body and a constant torque explain of each body axis.

    Attributes
    ----------
    constant : array, shape (3,), N m
        Constant body torque fitted beside the rigid body.
    r2 : array, shape (3,)
        Share of the body torque explained by both.
    torque : array, shape (3,), N m
        Root mean square of the body torque.
    acceleration : array, shape (3,), rad/s^2
        Root mean square of the derivative of the body rates.
    """

    constant: Array
    r2: Array
    torque: Array
    acceleration: Array


def axis_evidence(data: TorqueData, rank_tolerance: float) -> AxisEvidence:
    """Fit six inertia parameters and a constant body torque.

    Parameters
    ----------
    data : TorqueData
    rank_tolerance : float

    Returns
    -------
    AxisEvidence
    """
    rigid = rigid_columns(data.motion)
    constant = euler_rate_matrix(data.motion.attitude).swapaxes(1, 2)
    columns = np.concatenate([rigid, constant], axis=2)
    scale = 1.0 / axis_scale(data.torque)
    matrix, right_side = columns * scale[:, None], data.torque * scale
    parameters = solve(matrix.reshape(-1, columns.shape[2]), right_side.reshape(-1), rank_tolerance).coefficients
    attitude = data.motion.attitude
    measured = body_torque(attitude, data.torque)
    r2 = r_squared(measured, measured - body_torque(attitude, columns @ parameters))
    accelerated = body_acceleration(attitude, data.motion.rate, data.motion.acceleration)
    return AxisEvidence(parameters[rigid.shape[2] :], r2, _root_mean_square(measured), _root_mean_square(accelerated))


def _root_mean_square(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
