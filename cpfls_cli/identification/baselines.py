"""Models that any other must beat: rigid body, constant inertia, no torque at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.least_squares import Triangle
from cpfls_cli.inertia import symmetric_columns
from cpfls_cli.regressor.motion import Motion, rigid_columns

Columns = Callable[[Motion], Array]


@dataclass(frozen=True)
class Baseline:
    """A linear model with few parameters.

    Attributes
    ----------
    name : str
    columns : callable
        Motion to columns, shape (samples, 3, parameters).
    parameters : array, shape (parameters,)
    """

    name: str
    columns: Columns
    parameters: Array

    def torque(self, motion: Motion) -> Array:
        """Predict the generalised torque, shape (samples, 3), N m."""
        return np.asarray(self.columns(motion) @ self.parameters)


def constant_inertia_columns(motion: Motion) -> Array:
    """Columns of a constant symmetric J in ``J qdd``: J11, J22, J33, J12, J13, J23.

    Returns
    -------
    array, shape (samples, 3, 6)
    """
    return symmetric_columns(motion.acceleration)


def no_torque_columns(motion: Motion) -> Array:
    """Columns of the prediction that no torque acts: none.

    Returns
    -------
    array, shape (samples, 3, 0)
    """
    return np.zeros((len(motion), 3, 0))


def fit_baselines(source: TorqueSource, row_scale: Array, rank_tolerance: float) -> tuple[Baseline, ...]:
    """Fit all baselines to the samples that a model is trained on.

    Parameters
    ----------
    source : TorqueSource
    row_scale : array, shape (3,)
        Weight of each axis, the model's own.
    rank_tolerance : float

    Returns
    -------
    tuple of Baseline
        Rigid body, constant inertia, torque zero.
    """
    kinds: tuple[tuple[str, Columns], ...] = (
        ("rigid-body", rigid_columns),
        ("constant-inertia", constant_inertia_columns),
        ("torque-zero", no_torque_columns),
    )
    return tuple(Baseline(name, columns, _fit(columns, source, row_scale, rank_tolerance)) for name, columns in kinds)


def _fit(columns: Columns, source: TorqueSource, row_scale: Array, rank_tolerance: float) -> Array:
    blocks = ((columns(data.motion) * row_scale[:, None], data.torque * row_scale) for data in source.chunks())
    rows = ((matrix.reshape(torque.size, matrix.shape[2]), torque.reshape(-1)) for matrix, torque in blocks)
    return Triangle.of(rows).solve(rank_tolerance).coefficients
