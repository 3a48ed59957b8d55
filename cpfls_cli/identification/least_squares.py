"""Minimum-norm least squares by singular value decomposition, block of samples after block."""

from __future__ import annotations

from collections.abc import Iterable
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
    singular_values : array, shape (min(rows, parameters),)
        Descending.
    rank : int
        Number of singular values above the tolerance.
    row_space : array, shape (rank, parameters)
        Orthonormal basis of the directions that the data determine.
    rank_tolerance : float
        Singular values below this share of the largest counted as zero.
    """

    coefficients: Array
    singular_values: Array
    rank: int
    row_space: Array
    rank_tolerance: float

    @property
    def parameters(self) -> int:
        """Number of parameters."""
        return len(self.coefficients)

    @property
    def condition_number(self) -> float:
        """Largest over smallest kept singular value; infinite for rank zero."""
        if self.rank == 0:
            return float("inf")
        return float(self.singular_values[0] / self.singular_values[self.rank - 1])


@dataclass(frozen=True)
class Triangle:
    """Triangular factor of columns and a right-hand side: all that least squares need to know of any number of rows.

    Attributes
    ----------
    matrix : array, shape (up to parameters + 1, parameters + 1)
        ``R`` of a QR decomposition of the columns with the right-hand side as the last one.
    """

    matrix: Array

    @classmethod
    def of(cls, blocks: Iterable[tuple[Array, Array]]) -> Triangle:
        """Decompose rows block by block.

        Parameters
        ----------
        blocks : iterable of tuple of array
            Columns, shape (rows, parameters), and right-hand side, shape (rows,), block by block.
        """
        triangle: Array | None = None
        for columns, right_side in blocks:
            block = np.column_stack([columns, right_side])
            stacked = block if triangle is None else np.vstack([triangle, block])
            R = linalg.qr(stacked, mode="r", check_finite=False, overwrite_a=True)[0]
            triangle = np.asarray(R[: R.shape[1]], dtype=float)
        if triangle is None:
            raise ValueError("no rows")
        return cls(triangle)

    def below(self, rows: Array) -> Triangle:
        """Add rows whose right-hand side is zero, such as those of a penalty, shape (rows, parameters)."""
        return Triangle(np.vstack([self.matrix, np.column_stack([rows, np.zeros(len(rows))])]))

    def square(self, parameters: Array) -> float:
        """Sum of the squared residuals of all rows."""
        return float(np.sum((self.matrix[:, -1] - self.matrix[:, :-1] @ parameters) ** 2))

    def solve(self, rank_tolerance: float) -> LeastSquares:
        """Solve for the parameters of smallest norm.

        Parameters
        ----------
        rank_tolerance : float
            Singular values below this share of the largest count as zero.
        """
        return solve(self.matrix[:, :-1], self.matrix[:, -1], rank_tolerance)


def solve(matrix: Array, right_side: Array, rank_tolerance: float) -> LeastSquares:
    """Solve ``min |matrix c - right_side|`` for the c of smallest norm.

    Parameters
    ----------
    matrix : array, shape (rows, parameters)
    right_side : array, shape (rows,)
    rank_tolerance : float
        Singular values below this share of the largest count as zero.

    References
    ----------
    Paper section 5: ``c = V S^-1 U^T tau``; method.md section 5 for rank-deficient data.
    """
    U, singular_values, Vt = linalg.svd(matrix, full_matrices=False, check_finite=False, lapack_driver="gesdd")
    largest = singular_values[0] if len(singular_values) else 0.0
    rank = int(np.count_nonzero(singular_values > rank_tolerance * largest)) if largest > 0 else 0
    projected = U[:, :rank].T @ right_side
    coefficients = Vt[:rank].T @ (projected / singular_values[:rank])
    return LeastSquares(coefficients, singular_values, rank, Vt[:rank], rank_tolerance)
