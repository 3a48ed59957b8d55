"""Triangular factor of the chosen rows: their singular values without squaring the condition number."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.linalg

from cpfls_cli.arrays import Array


class TriangularFactor:
    """``T`` with ``T^T T = G``, the Gram matrix of the chosen rows, kept by QR as samples are added.

    Singular values below the tolerance, a fraction of the largest, count as zero.
    """

    def __init__(self, columns: int, rank_tolerance: float) -> None:
        self._triangle: Array = np.zeros((columns, columns))
        self._tolerance = rank_tolerance

    def add(self, rows: Array) -> None:
        """Add the rows of one sample or of several, array of shape (rows, columns)."""
        stacked = np.vstack([self._triangle, rows])
        triangle = scipy.linalg.qr(stacked, mode="r", check_finite=False)[0]
        self._triangle = np.asarray(triangle[: self.columns], dtype=np.float64)
        for name in ("singular_values", "singular_vectors"):
            self.__dict__.pop(name, None)

    @cached_property
    def singular_values(self) -> Array:
        """Singular values of the chosen rows, descending."""
        return np.asarray(np.linalg.svd(self._triangle, compute_uv=False), dtype=np.float64)

    @cached_property
    def singular_vectors(self) -> Array:
        """Right singular vectors of the chosen rows, in columns."""
        return np.linalg.svd(self._triangle)[2].T

    def solve(self, rows: Array) -> Array:
        """Solve ``G X = rows^T``; the rank must be full.

        Parameters
        ----------
        rows : array, shape (rows, columns)

        Returns
        -------
        array, shape (columns, rows)
        """
        half = scipy.linalg.solve_triangular(self._triangle, rows.T, trans="T", check_finite=False)
        return np.asarray(scipy.linalg.solve_triangular(self._triangle, half, check_finite=False))

    @property
    def columns(self) -> int:
        """Length of a row."""
        return len(self._triangle)

    @property
    def rank(self) -> int:
        """Numerical rank of the chosen rows."""
        return int(np.count_nonzero(self.singular_values > self._tolerance * self.singular_values[0]))

    @property
    def full_rank(self) -> bool:
        """Whether the rows span all columns."""
        return self.rank == self.columns

    @property
    def singular_value_min(self) -> float:
        """Smallest singular value, zero below full rank."""
        return float(self.singular_values[-1]) if self.full_rank else 0.0

    @property
    def singular_value_max(self) -> float:
        """Largest singular value."""
        return float(self.singular_values[0])

    @property
    def condition_number(self) -> float:
        """Largest over smallest singular value, infinite below full rank."""
        return self.singular_value_max / self.singular_value_min if self.full_rank else float("inf")
