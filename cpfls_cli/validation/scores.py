"""Sums over blocks of samples that linear least squares scatter by."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.least_squares import SMALLEST_SINGULAR_SHARE

POWER = 0.75
"""Of the correction for leverage: between 1/2, CR2, and 1, CR3; benchmarks/band_coverage.py measures all three."""

# A direction that one block alone determines leaves it no residual: there the correction would find rounding.
_SMALLEST_REST = 1e-3


@dataclass(frozen=True)
class BlockScores:
    """Least squares ``(A^T A + P) x = A^T tau`` by block.

    Attributes
    ----------
    gram : array, shape (blocks, parameters, parameters)
        ``A_b^T A_b`` of each block.
    score : array, shape (blocks, parameters)
        ``A_b^T r_b`` of its residuals.
    penalty : array, shape (parameters,)
        Diagonal of P.
    parameters : array, shape (parameters,)
        x.
    power : float, optional
        Of the correction for what the fit has followed of the noise.
    """

    gram: Array
    score: Array
    penalty: Array
    parameters: Array
    power: float = POWER

    def draws(self, weights: Array, rank_tolerance: float) -> Array:
        """Weight the blocks.

        Parameters
        ----------
        weights : array, shape (draws, blocks)
        rank_tolerance : float
            Singular values below this share of the largest count as zero.

        Returns
        -------
        array, shape (draws, parameters)
            Deviations from x.
        """
        half = self._half_inverse(rank_tolerance)
        values, vectors = np.linalg.eigh(half.T @ self.gram @ half)
        along = np.einsum("bij,bi->bj", vectors, self.score @ half)
        along *= np.maximum(1.0 - values, _SMALLEST_REST) ** -self.power
        return np.asarray(weights @ np.einsum("bij,bj->bi", vectors, along) @ half.T)

    def under(self, penalty: Array, rank_tolerance: float) -> BlockScores:
        """Solve the same least squares under another penalty.

        Parameters
        ----------
        penalty : array, shape (parameters,)
        rank_tolerance : float
        """
        half = replace(self, penalty=penalty)._half_inverse(rank_tolerance)
        # The scores add up to P x: taken from there, parameters without a penalty do not move by rounding.
        step = half @ (half.T @ ((self.penalty - penalty) * self.parameters))
        return replace(self, score=self.score - self.gram @ step, penalty=penalty, parameters=self.parameters + step)

    def left(self, values: Array, rank_tolerance: float) -> Array:
        """Leave of parameters what the samples do not determine, ``(A^T A + P)^-1 P z``.

        Parameters
        ----------
        values : array, shape (draws, parameters)
            z.
        rank_tolerance : float

        Returns
        -------
        array, shape (draws, parameters)
        """
        half = self._half_inverse(rank_tolerance)
        kept = half / np.linalg.norm(half, axis=0)
        return np.asarray((values * self.penalty) @ half @ half.T + values - values @ kept @ kept.T)

    def solution(self, rank_tolerance: float) -> Array:
        """Solve for the parameters of smallest norm that the scores, taken as ``A_b^T tau_b``, ask for."""
        half = self._half_inverse(rank_tolerance)
        return np.asarray(half @ (half.T @ np.sum(self.score, axis=0)))

    def _half_inverse(self, rank_tolerance: float) -> Array:
        """V with ``V V^T = (A^T A + P)^-1`` over what the samples determine, shape (parameters, rank)."""
        values, vectors = np.linalg.eigh(np.sum(self.gram, axis=0) + np.diag(self.penalty))
        kept = values > max(rank_tolerance, SMALLEST_SINGULAR_SHARE) ** 2 * max(values[-1], 0.0)
        return np.asarray(vectors[:, kept] / np.sqrt(values[kept]))
