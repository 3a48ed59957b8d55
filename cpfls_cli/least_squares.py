"""Minimum-norm least squares: from rows, block after block, or from sums of products; and steps to the least sum."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray


def damped_step(hessian: Array, gradient: Array, damping: float, low: Array, high: Array) -> Array:
    """Solve for a damped step: numbers that it would take beyond a bound go there, and the others move again.

    Fits whose residuals fit into memory have `scipy.optimize.least_squares`; here sums over them are all that is known.

    Parameters
    ----------
    hessian : array, shape (number, number)
        ``J^T J`` of residuals r with Jacobian J.
    gradient : array, shape (number,)
        ``J^T r``.
    damping : float
        Share of the diagonal that is added to it.
    low, high : array, shape (number,)
        Bounds of the step, not above and not below 0.

    Returns
    -------
    array, shape (number,)

    References
    ----------
    Marquardt, J. SIAM 11 (1963).
    """
    diagonal, step = np.diag(hessian), np.zeros(len(gradient))
    # A number that moves nothing stays.
    damped = hessian + np.diag(damping * diagonal + np.where(diagonal > 0, 0.0, 1.0))
    free: BoolArray = ~(((high <= 0) & (gradient < 0)) | ((low >= 0) & (gradient > 0)))
    while free.any():
        right = gradient[free] + damped[np.ix_(free, ~free)] @ step[~free]
        step[free] = -np.linalg.solve(damped[np.ix_(free, free)], right)
        beyond = free & ((step < low) | (step > high))
        if not beyond.any():
            break
        step[beyond] = np.clip(step, low, high)[beyond]
        free &= ~beyond
    return step


Project = Callable[[Array, Array], tuple[Array, Array]]
SMALLEST_SINGULAR_SHARE = 3e-7
"""Products square the singular values, so below this share of the largest one they are rounding."""
# Up to here the squares have digits enough; above, the lowest directions are multiplied out once more.
_WELL_CONDITIONED = 3e3
_LOWEST_DIRECTIONS = 3


@dataclass(frozen=True)
class LeastSquares:
    """Solution of a linear least-squares problem, of minimum norm where the data do not determine all.

    `singular_values` descend; `rank` of them are above `rank_tolerance`, a share of the largest; `row_space`:
    orthonormal basis of the directions that the data determine, shape (rank, parameters).
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
    """Triangular factor of columns and a right-hand side, which stands for any number of rows.

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
        from scipy import linalg

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
        """Solve for the parameters of smallest norm."""
        return solve(self.matrix[:, :-1], self.matrix[:, -1], rank_tolerance)


def solve(matrix: Array, right_side: Array, rank_tolerance: float) -> LeastSquares:
    """Solve ``min |matrix c - right_side|`` for the c of smallest norm.

    Paper section 5: ``c = V S^-1 U^T tau``; method.md section 5 for rank-deficient data.
    """
    from scipy import linalg

    U, singular_values, Vt = linalg.svd(matrix, full_matrices=False, check_finite=False, lapack_driver="gesdd")
    largest = singular_values[0] if len(singular_values) else 0.0
    rank = int(np.count_nonzero(singular_values > rank_tolerance * largest)) if largest > 0 else 0
    projected = U[:, :rank].T @ right_side
    coefficients = Vt[:rank].T @ (projected / singular_values[:rank])
    return LeastSquares(coefficients, singular_values, rank, Vt[:rank], rank_tolerance)


@dataclass(frozen=True)
class NormalEquations:
    """``(A^T A + P) x = A^T tau`` with a diagonal P that penalises some parameters.

    `gram`: ``A^T A`` of scaled columns; `moment`: ``A^T tau``; `penalty`: diagonal of P.
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
    """Solution of normal equations, of minimum norm where the samples do not determine all.

    `conditioning`: condition number of the columns; above every condition number where some are dependent.
    """

    parameters: Array
    conditioning: float


def solve_normal(equations: NormalEquations, rank_tolerance: float, project: Project) -> NormalSolution:
    """Solve normal equations as accurately as a decomposition of the columns would.

    The eigenvalues are the squares of the singular values, so a condition number near 1e6 would be left with four
    digits. Where it is large and the rank full, the residual and the columns along the lowest eigenvectors are
    therefore computed from the samples themselves: one step of iterative refinement for the parameters, Rayleigh-Ritz
    for the lowest singular value. `project` takes parameters x and directions V to ``(A V)^T (A V)`` and ``A^T (tau - A
    x)``; `rank_tolerance` is a share of the largest singular value, not smaller than `SMALLEST_SINGULAR_SHARE`. Björck,
    Numerical Methods for Least Squares Problems (1996), sections 2.9 and 6.6 (accuracy of the normal equations,
    refinement).
    """
    tolerance = max(rank_tolerance, SMALLEST_SINGULAR_SHARE)
    eigenvalues, vectors = np.linalg.eigh(equations.matrix)
    kept = eigenvalues > tolerance**2 * eigenvalues[-1]
    if not kept.any():
        return NormalSolution(np.zeros_like(equations.moment), float("inf"))
    inverse, basis = 1.0 / eigenvalues[kept], vectors[:, kept]
    parameters = basis @ (inverse * (basis.T @ equations.moment))
    if missing := len(kept) - len(inverse):
        # No refinement: the condition number is this, whatever the smallest singular value is.
        return NormalSolution(parameters, (1.0 + missing) / tolerance)
    smallest, largest = eigenvalues[0], eigenvalues[-1]
    if largest > _WELL_CONDITIONED**2 * smallest:
        lowest = vectors[:, :_LOWEST_DIRECTIONS]
        square, back = project(parameters, lowest)
        parameters = parameters + basis @ (inverse * (basis.T @ (back - equations.penalty * parameters)))
        smallest = np.linalg.eigvalsh(square + (lowest.T * equations.penalty) @ lowest)[0]
    return NormalSolution(parameters, float(np.sqrt(largest / smallest)))


def quick_solution(equations: NormalEquations) -> tuple[Array, tuple[Array, bool], Array]:
    """Solve normal equations by Cholesky decomposition, with a tiny ridge for dependent columns.

    The factor, for `scipy.linalg.cho_solve`, is of the matrix with rows and columns multiplied by the scale.
    """
    from scipy import linalg

    matrix = equations.matrix
    diagonal = np.diag(matrix)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    unit = matrix * scale * scale[:, None]
    # Far below the noise of any flight, far above the rounding that lets the decomposition fail.
    unit[np.diag_indices(len(unit))] += 1e-12
    factor = linalg.cho_factor(unit, check_finite=False)
    return scale * linalg.cho_solve(factor, scale * equations.moment, check_finite=False), factor, scale
