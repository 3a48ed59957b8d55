"""Least squares from sums of products: one symmetric eigendecomposition, and what it loses given back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from cpfls_cli.arrays import Array

Project = Callable[[Array, Array], tuple[Array, Array]]

SMALLEST_SINGULAR_SHARE = 3e-7
"""Products square the singular values, so below this share of the largest one they are rounding."""

# Up to here the squares have digits enough; above, the lowest directions are multiplied out once more.
_WELL_CONDITIONED = 1e4
_LOWEST_DIRECTIONS = 3


@dataclass(frozen=True)
class NormalEquations:
    """``(A^T A + P) x = A^T tau`` with a diagonal P that penalises some parameters.

    Attributes
    ----------
    gram : array, shape (parameters, parameters)
        ``A^T A`` of scaled columns.
    moment : array, shape (parameters,)
        ``A^T tau``.
    penalty : array, shape (parameters,)
        Diagonal of P.
    """

    gram: Array
    moment: Array
    penalty: Array

    @property
    def matrix(self) -> Array:
        """The matrix to invert, shape (parameters, parameters)."""
        matrix = self.gram.copy()
        matrix[np.diag_indices(len(matrix))] += self.penalty
        return matrix


@dataclass(frozen=True)
class NormalSolution:
    """Solution of normal equations.

    Attributes
    ----------
    parameters : array, shape (parameters,)
        Of minimum norm where the samples do not determine all.
    conditioning : float
        Condition number of the columns; above every condition number where some are dependent.
    """

    parameters: Array
    conditioning: float


def solve_normal(equations: NormalEquations, rank_tolerance: float, project: Project) -> NormalSolution:
    """Solve normal equations as accurately as a decomposition of the columns would.

    The eigenvalues are the squares of the singular values, so a condition number near 1e6 would be left with four
    digits. Where it is large, the residual and the columns along the lowest eigenvectors are therefore computed from
    the samples themselves: one step of iterative refinement for the parameters, Rayleigh-Ritz for the lowest singular
    value.

    Parameters
    ----------
    equations : NormalEquations
    rank_tolerance : float
        Singular values below this share of the largest count as zero; not smaller than `SMALLEST_SINGULAR_SHARE`.
    project : callable
        Takes parameters x and directions V, gives ``(A V)^T (A V)`` and ``A^T (tau - A x)``.

    References
    ----------
    Björck, Numerical Methods for Least Squares Problems (1996), sections 2.9 and 6.6 (accuracy of the normal equations,
    refinement).
    """
    eigenvalues, vectors = np.linalg.eigh(equations.matrix)
    tolerance = max(rank_tolerance, SMALLEST_SINGULAR_SHARE)
    kept = eigenvalues > tolerance**2 * eigenvalues[-1]
    rank = int(np.count_nonzero(kept))
    if rank == 0:
        return NormalSolution(np.zeros_like(eigenvalues), float("inf"))
    inverse, basis = 1.0 / eigenvalues[kept], vectors[:, kept]
    parameters = basis @ (inverse * (basis.T @ equations.moment))
    smallest = 1.0 / inverse[0]
    if eigenvalues[-1] > _WELL_CONDITIONED**2 * smallest:
        lowest = basis[:, :_LOWEST_DIRECTIONS]
        square, back = project(parameters, lowest)
        parameters = parameters + basis @ (inverse * (basis.T @ (back - equations.penalty * parameters)))
        smallest = np.linalg.eigvalsh(square + (lowest.T * equations.penalty) @ lowest)[0]
    missing = len(eigenvalues) - rank
    condition = float(np.sqrt(eigenvalues[-1] / smallest))
    return NormalSolution(parameters, condition if missing == 0 else (1.0 + missing) / tolerance)


def quick_solution(equations: NormalEquations) -> tuple[Array, tuple[Array, bool], Array]:
    """Solve normal equations by Cholesky decomposition, with a trace of ridge where columns are dependent.

    Returns
    -------
    parameters : array, shape (parameters,)
    factor : tuple
        For `scipy.linalg.cho_solve`, of the matrix with rows and columns multiplied by `scale`.
    scale : array, shape (parameters,)
    """
    matrix = equations.matrix
    diagonal = np.diag(matrix)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    unit = matrix * scale * scale[:, None]
    # Far below the noise of any flight, far above the rounding that lets the decomposition fail.
    unit[np.diag_indices(len(unit))] += 1e-12
    factor = linalg.cho_factor(unit, check_finite=False)
    return scale * linalg.cho_solve(factor, scale * equations.moment, check_finite=False), factor, scale
