"""The regressor in coordinates of its own row space, where it has full column rank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.reduction.survey import Spectrum, Survey, survey


@dataclass(frozen=True)
class RowSpace(Spectrum):
    """Samples of a regressor, expressed in an orthonormal basis of the row space of all its samples.

    Attributes
    ----------
    rows : array, shape (samples, 3, rank)
        ``Q V_r``: the same nonzero singular values as Q, for every subset of samples.
    singular_values : array, shape (rank,), descending
        Kept singular values of all samples.
    parameters : int
        Columns of Q.
    rank_tolerance : float
        Singular values below this fraction of the largest count as zero.
    """

    rows: Array
    singular_values: Array
    parameters: int
    rank_tolerance: float

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.rows)

    @property
    def smallest_samples(self) -> int:
        """Fewest samples that can reach the rank, at three rows each."""
        return -(-self.rank // 3)


def row_space(Q: Array, rank_tolerance: float) -> RowSpace:
    """Project a regressor on its numerical row space, ``R_i = Q_i V_r``.

    Parameters
    ----------
    Q : array, shape (samples, 3, parameters)
    rank_tolerance : float
        Singular values below this fraction of the largest count as zero.

    Raises
    ------
    ComputationError
        If the shape is wrong, a value is not finite, or all values are zero.
    """
    surveyed = survey(lambda: [Q], rank_tolerance)
    return space_of(surveyed, np.concatenate(list(surveyed.projected())))


def space_of(surveyed: Survey, rows: Array) -> RowSpace:
    """Place samples in the row space of a surveyed regressor.

    Parameters
    ----------
    surveyed : Survey
    rows : array, shape (samples, 3, rank)
        Some or all of its samples, projected.
    """
    return RowSpace(rows, surveyed.singular_values, surveyed.parameters, surveyed.rank_tolerance)
