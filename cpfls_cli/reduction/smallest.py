"""Choose the sample that raises the smallest singular value most, without evaluating them all."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.reduction.factor import TriangularFactor
from cpfls_cli.reduction.lazy_search import lazy_best
from cpfls_cli.reduction.survey import project
from cpfls_cli.reduction.updated_spectrum import eigenvalues_below

# Lowest eigenvectors of the successive Rayleigh-Ritz bounds for the samples still in doubt.
_BOUND_VECTORS = (6, 24)


class SmallestSingularValue:
    """Maximise ``sigma_min`` of the chosen rows; their rank must be full.

    Parameters
    ----------
    rows : array, shape (samples, 3, columns)
    """

    def __init__(self, rows: Array) -> None:
        self._rows = rows

    def next_sample(self, factor: TriangularFactor, available: BoolArray) -> int:
        """Name the sample with the largest ``lambda_min(G + R_i^T R_i)``.

        Upper bounds for all samples come from the two lowest eigenvectors. The best few by the bound are
        evaluated; better bounds then discard every sample that cannot reach the level found, and only the rest
        are compared exactly. The result is the same as if all had been evaluated.

        Parameters
        ----------
        factor : TriangularFactor
        available : array of bool, shape (samples,)

        References
        ----------
        Paper, section 8, step 1; method.md, section 6.
        """
        eigenvalues = factor.singular_values[::-1] ** 2
        vectors = factor.singular_vectors[:, ::-1]
        bounds = smallest_eigenvalue_bound(eigenvalues, project(self._rows, vectors[:, :2]))

        def exceeds(projections: Array, level: float) -> BoolArray:
            kept = projections.shape[2]
            return np.asarray(eigenvalues_below(eigenvalues[:kept], projections, level) == 0)

        bounds = np.where(available, bounds, -np.inf)
        return lazy_best(self._rows, vectors, bounds, eigenvalues[0], exceeds, _BOUND_VECTORS)


def smallest_eigenvalue_bound(eigenvalues: Array, projections: Array) -> Array:
    """Bound ``lambda_min(G + R_i^T R_i)`` from above, by its Rayleigh-Ritz value on two eigenvectors of G.

    Parameters
    ----------
    eigenvalues : array, shape (columns,), ascending
        Eigenvalues of G.
    projections : array, shape (samples, 3, 2)
        Rows of each sample along the two lowest eigenvectors; with one column, along the only one.

    Returns
    -------
    array, shape (samples,)
    """
    squares = np.einsum("nij,nij->nj", projections, projections)
    if projections.shape[2] == 1:
        return np.asarray(eigenvalues[0] + squares[:, 0])
    first, second = eigenvalues[0] + squares[:, 0], eigenvalues[1] + squares[:, 1]
    coupling = np.einsum("ni,ni->n", projections[:, :, 0], projections[:, :, 1])
    bound = 0.5 * (first + second) - np.hypot(0.5 * (first - second), coupling)
    rounding = 4.0 * np.finfo(float).eps * (first + second)
    return np.asarray(bound + rounding)
