"""What is controlled: the exact rigid body, or a model in its place."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.control.laws import TorqueModel
from cpfls_cli.regressor.motion import Motion

Plant = Callable[[Array, Array, Array], Array]
"""Takes attitude, body rate and body torque, shape (vehicle, 3) each; gives the derivative of the body rate."""


def rigid_plant(inertia: Array) -> Plant:
    """Turn as a rigid body does, ``I omega' = M - omega x I omega``.

    Parameters
    ----------
    inertia : array, shape (3, 3), kg m^2, body frame
    """
    inverse = np.linalg.inv(inertia)

    def turning(_attitude: Array, body_rate: Array, body_torque: Array) -> Array:
        p, q, r = body_rate.T
        x, y, z = (body_rate @ inertia).T
        gyroscopic = np.array([q * z - r * y, r * x - p * z, p * y - q * x]).T
        return np.asarray((body_torque - gyroscopic) @ inverse)

    return turning


def model_plant(model: TorqueModel) -> Plant:
    """Turn as a model in Euler coordinates does, ``D(q) qdd = W^T M - C(q, qd) qd``.

    Returns
    -------
    callable
        What it gives is not finite where the model has no inertia to turn.
    """

    def turning(attitude: Array, body_rate: Array, body_torque: Array) -> Array:
        rate = rotations.attitude_rate(attitude, body_rate)
        still, units = np.zeros_like(rate), [np.broadcast_to(axis, rate.shape) for axis in np.eye(3)]
        # One call for C qd and the three columns of D: the model has more to do once than for each sample.
        rates, accelerations = np.concatenate([rate, still, still, still]), np.concatenate([still, *units])
        torques = model.torque(Motion(np.tile(attitude, (4, 1)), rates, accelerations)).reshape(4, -1, 3)
        inertia = np.stack([torques[1], torques[2], torques[3]], axis=2)
        needed = rotations.generalised_torque(attitude, body_torque) - torques[0]
        return rotations.body_acceleration(attitude, rate, _solved(inertia, needed))

    return turning


def _solved(inertia: Array, torque: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(inertia, torque[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.full_like(torque, np.nan)
