"""Minimum-norm least squares by singular value decomposition, with its rank and condition number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from cpfls_cli.arrays import Array


@dataclass(frozen=True)
class LeastSquares:
    """Solution of a linear least-squares problem.

    Attributes
    ----------
    coefficients : array, shape (parameters,)
        Of minimum norm where the data do not determine all.
    residual : array, shape (rows,)
        Right-hand side minus fit.
    singular_values : array, shape (min(rows, parameters),)
        Descending.
    rank : int
        Number of singular values above the tolerance.
    range_basis : array, shape (rows, rank)
        Orthonormal basis of what the columns span.
    row_space : array, shape (rank, parameters)
        Orthonormal basis of the directions that the data determine.
    rank_tolerance : float
        Singular values below this share of the largest counted as zero.
    """

    coefficients: Array
    residual: Array
    singular_values: Array
    rank: int
    range_basis: Array
    row_space: Array
    rank_tolerance: float

    @property
    def condition_number(self) -> float:
        """Largest over smallest kept singular value; infinite for rank zero."""
        if self.rank == 0:
            return float("inf")
        return float(self.singular_values[0] / self.singular_values[self.rank - 1])

    @property
    def conditioning(self) -> float:
        """Condition number for comparing systems: one of smaller rank is always worse, and finite.

        Over the kept singular values alone, a system would gain by losing rank.
        """
        missing = len(self.singular_values) - self.rank
        return self.condition_number if missing == 0 else (1.0 + missing) / self.rank_tolerance

    def reject(self, columns: Array) -> Array:
        """Project columns off what the regressor spans.

        Parameters
        ----------
        columns : array, shape (rows, n)

        Returns
        -------
        array, shape (rows, n)
        """
        return np.asarray(columns - self.range_basis @ (self.range_basis.T @ columns))


def solve(matrix: Array, right_side: Array, rank_tolerance: float) -> LeastSquares:
    """Solve ``min |matrix c - right_side|`` for the c of smallest norm.

    Parameters
    ----------
    matrix : array, shape (rows, parameters)
    right_side : array, shape (rows,)
    rank_tolerance : float
        Singular values below this share of the largest count as zero.

    Returns
    -------
    LeastSquares

    References
    ----------
    Paper section 5: ``c = V S^-1 U^T tau``; method.md section 5 for rank-deficient data.
    """
    U, singular_values, Vt = linalg.svd(matrix, full_matrices=False, check_finite=False, lapack_driver="gesdd")
    largest = singular_values[0] if len(singular_values) else 0.0
    rank = int(np.count_nonzero(singular_values > rank_tolerance * largest)) if largest > 0 else 0
    range_basis, row_space = U[:, :rank], Vt[:rank]
    projected = range_basis.T @ right_side
    coefficients = row_space.T @ (projected / singular_values[:rank])
    residual = right_side - range_basis @ projected
    return LeastSquares(coefficients, residual, singular_values, rank, range_basis, row_space, rank_tolerance)
