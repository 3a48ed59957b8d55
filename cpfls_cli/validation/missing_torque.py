"""The constant torque that a model misses: trim, a centre of mass beside the axes, the bias of a sensor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.rigid_body import vertical
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.regressor.motion import Motion


def mean_missing_torque(source: TorqueSource, torque: Callable[[Motion], Array]) -> Array:
    """Average the body torque that a model misses, measured minus predicted, away from a vertical pitch.

    Parameters
    ----------
    source : TorqueSource
    torque : callable
        Predicts the generalised torque of a motion.

    Returns
    -------
    array, shape (3,), N m, body frame
        0 where the pitch is vertical throughout.
    """
    total, count = np.zeros(3), 0
    for data in source.chunks():
        told = ~vertical(data.motion.attitude)
        missing = (data.torque - torque(data.motion))[told]
        total += np.sum(rotations.body_torque(data.motion.attitude[told], missing), axis=0)
        count += len(missing)
    return total / max(count, 1)


def with_constant(torque: Callable[[Motion], Array], constant: Array) -> Callable[[Motion], Array]:
    """Add a constant body torque to the predictions of a model.

    Parameters
    ----------
    torque : callable
        Predicts the generalised torque of a motion.
    constant : array, shape (3,), N m, body frame
    """

    def predicted(motion: Motion) -> Array:
        everywhere = np.broadcast_to(constant, (len(motion), 3))
        return torque(motion) + rotations.generalised_torque(motion.attitude, everywhere)

    return predicted
