"""The rule as the paper prints it, which stalls below full rank."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.reduction.factor import TriangularFactor
from cpfls_cli.reduction.lazy_search import lazy_best
from cpfls_cli.reduction.smallest import SmallestSingularValue
from cpfls_cli.reduction.survey import project
from cpfls_cli.reduction.updated_spectrum import eigenvalues_below

# A rise below this fraction is rounding.
_SMALLEST_RISE = 1e-12


class PrintedRule:
    """Raise the smallest singular value most; where no sample raises it, raise the largest one most.

    Parameters
    ----------
    rows : array, shape (samples, 3, columns)
    rank_tolerance : float
        Singular values below this fraction of the largest count as zero.
    full_column_rank : bool
        Whether all samples together determine every parameter. If not, the smallest singular value over all
        parameters is zero whatever is chosen.
    """

    def __init__(self, rows: Array, rank_tolerance: float, *, full_column_rank: bool) -> None:
        self._rows = rows
        self._tolerance = rank_tolerance
        self._full_column_rank = full_column_rank
        self._smallest = SmallestSingularValue(rows)
        self._lengths = np.einsum("nij,nij->n", rows, rows)

    def next_sample(self, factor: TriangularFactor, available: BoolArray) -> int:
        """Name the sample that raises ``sigma_min`` most, else the one that raises ``sigma_max`` most.

        Parameters
        ----------
        factor : TriangularFactor
        available : array of bool, shape (samples,)

        References
        ----------
        Paper, section 8, step 1.
        """
        if self._full_column_rank and factor.rank >= factor.columns - 3:
            index = self._smallest.next_sample(factor, available)
            if self._raises(factor, index):
                return index
        return self._largest(factor, available)

    def _raises(self, factor: TriangularFactor, index: int) -> bool:
        stacked = np.vstack([np.diag(factor.singular_values), self._rows[index] @ factor.singular_vectors])
        values = np.linalg.svd(stacked, compute_uv=False)
        nonzero = values[-1] > self._tolerance * values[0]
        return bool(nonzero and values[-1] > factor.singular_value_min * (1.0 + _SMALLEST_RISE))

    def _largest(self, factor: TriangularFactor, available: BoolArray) -> int:
        eigenvalues, vectors = factor.singular_values**2, factor.singular_vectors
        along = project(self._rows, vectors[:, :1])[:, :, 0]
        bounds = largest_eigenvalue_bound(eigenvalues, along, self._lengths)

        def exceeds(projections: Array, level: float) -> BoolArray:
            return np.asarray(eigenvalues_below(eigenvalues, projections, level) < len(eigenvalues))

        return lazy_best(self._rows, vectors, np.where(available, bounds, -np.inf), eigenvalues[0], exceeds)


def largest_eigenvalue_bound(eigenvalues: Array, along: Array, lengths: Array) -> Array:
    """Bound ``lambda_max(G + R_i^T R_i)`` from above, by the 2x2 matrix of the norms of its blocks.

    The blocks are the top eigenvector of G and everything orthogonal to it.

    Parameters
    ----------
    eigenvalues : array, shape (columns,), descending
        Eigenvalues of G.
    along : array, shape (samples, 3)
        Rows of each sample along the top eigenvector.
    lengths : array, shape (samples,)
        Squared Frobenius norm of each sample's rows.

    Returns
    -------
    array, shape (samples,)
    """
    inside = np.einsum("ni,ni->n", along, along)
    outside = np.clip(lengths - inside, 0.0, None)
    first, second = eigenvalues[0] + inside, (eigenvalues[1] if len(eigenvalues) > 1 else 0.0) + outside
    bound = 0.5 * (first + second) + np.hypot(0.5 * (first - second), np.sqrt(inside * outside))
    return np.asarray(bound * (1.0 + 8.0 * np.finfo(float).eps))
