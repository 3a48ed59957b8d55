"""The regressor in coordinates of its own row space, where it has full column rank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError


@dataclass(frozen=True)
class RowSpace:
    """All samples of a regressor, expressed in an orthonormal basis of their row space.

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
    def rank(self) -> int:
        """Numerical rank of all samples."""
        return len(self.singular_values)

    @property
    def condition_number(self) -> float:
        """Condition number of all samples over the kept singular values."""
        return float(self.singular_values[0] / self.singular_values[-1])

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

    Returns
    -------
    RowSpace

    Raises
    ------
    ComputationError
        If the shape is wrong, a value is not finite, or all values are zero.
    """
    _require_regressor(Q)
    triangle = scipy.linalg.qr(Q.reshape(-1, Q.shape[2]), mode="r", check_finite=False)[0]
    _, values, basis = scipy.linalg.svd(triangle[: Q.shape[2]], full_matrices=False)
    rank = int(np.count_nonzero(values > rank_tolerance * values[0]))
    if rank == 0:
        raise ComputationError("Q: every value is zero, so no sample is worth more than another")
    return RowSpace(project(Q, basis[:rank].T), values[:rank], Q.shape[2], rank_tolerance)


def project(rows: Array, vectors: Array) -> Array:
    """Multiply every sample's rows with the same vectors, in one matrix product.

    Parameters
    ----------
    rows : array, shape (samples, 3, columns)
    vectors : array, shape (columns, vectors)

    Returns
    -------
    array, shape (samples, 3, vectors)
    """
    product: Array = rows.reshape(-1, rows.shape[2]) @ vectors
    return product.reshape(len(rows), 3, -1)


def _require_regressor(Q: Array) -> None:
    if Q.ndim != 3 or Q.shape[1] != 3 or 0 in Q.shape:
        raise ComputationError(f"Q: expected shape (samples, 3, parameters), got {Q.shape}")
    broken = np.flatnonzero(~np.isfinite(Q).all(axis=(1, 2)))
    if broken.size:
        raise ComputationError(
            f"Q: sample {broken[0]} is not finite ({broken.size} of {len(Q)} samples in all); "
            "remove such samples before the reduction"
        )
