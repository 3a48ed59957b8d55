"""Local search: partition weights refined by variable projection, the linear parameters eliminated."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import linalg
from scipy.optimize import least_squares

from cpfls_cli.arrays import Array
from cpfls_cli.identification.chromosome import decode, weight_jacobian
from cpfls_cli.identification.fit import Fit
from cpfls_cli.identification.normal_equations import quick_solution
from cpfls_cli.identification.solver import Solver


@dataclass(frozen=True)
class _Linearised:
    """The residual of all samples and its Jacobian, turned so that all but the first few rows are zero.

    A turn changes neither the sum of squares nor its derivatives, and a trust-region method sees nothing else.
    """

    residual: Array
    jacobian: Array


@dataclass
class _ReducedProblem:
    """Residual and Jacobian of the weights with the linear parameters solved for, each point computed once."""

    solver: Solver
    start: Fit
    _point: Array = field(default_factory=lambda: np.empty(0))
    _linearised: _Linearised | None = None

    def residual(self, weights: Array) -> Array:
        return self._at(weights).residual

    def jacobian(self, weights: Array) -> Array:
        return self._at(weights).jacobian

    def _at(self, weights: Array) -> _Linearised:
        if self._linearised is None or not np.array_equal(weights, self._point):
            self._linearised, self._point = _linearise(self.solver, weights, self.start), weights.copy()
        return self._linearised


def refine(solver: Solver, weights: Array, start: Fit, evaluations: int) -> Array:
    """Refine partition weights by nonlinear least squares with the linear parameters eliminated.

    Ridge weight and column sizes stay those of the start: a penalty that moved with the columns would add a term to
    the gradient that variable projection leaves out.

    Parameters
    ----------
    solver : Solver
    weights : array, shape (genes,)
        On [0, 1], no partition all zero.
    start : Fit
        The fit at these weights; its ridge weight is finite.
    evaluations : int
        Largest number of model evaluations.

    Returns
    -------
    array, shape (genes,)
        On [0, 1].

    References
    ----------
    method.md section 7; Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973); Kaufman, BIT 15 (1975).
    """
    problem = _ReducedProblem(solver, start)
    found = least_squares(
        problem.residual, weights, jac=problem.jacobian, bounds=(0.0, 1.0), max_nfev=evaluations, x_scale="jac"
    )
    return np.asarray(found.x, dtype=float)


def _linearise(solver: Solver, weights: Array, start: Fit) -> _Linearised:
    """Linearise the residual by Kaufman's approximation, from sums over samples alone.

    With M the derivatives of the torque by the weights at fixed parameters and A the columns, the Jacobian is
    ``J = -(I - A A^+) M``: so ``J^T J = M^T M - (A^T M)^T (A^T A)^-1 (A^T M)``, and ``J^T r = -M^T r`` because the
    residual is orthogonal to A.
    """
    structure = solver.learned.structure
    partitions = decode(structure, weights)
    equations = solver.equations(partitions, start.ridge_weight, start.column_size)
    solution, factor, scale = quick_solution(equations)
    coefficients, rigid_body = solver.parameters(solution, start.column_size)
    moved = solver.learned.moved(partitions, coefficients, rigid_body)
    by_weight = weight_jacobian(structure, weights)
    divide = np.ones(len(solution))
    divide[len(solution) - len(start.column_size) :] = start.column_size
    onto = (moved.columns @ by_weight) / divide[:, None]
    spanned = onto.T @ (scale[:, None] * linalg.cho_solve(factor, scale[:, None] * onto, check_finite=False))
    square = moved.square + float(equations.penalty @ solution**2)
    return _turned(by_weight.T @ moved.moved @ by_weight - spanned, -by_weight.T @ moved.residual, square)


def _turned(normal: Array, gradient: Array, square: float) -> _Linearised:
    """Find few rows with given ``J^T J``, ``J^T r`` and ``r^T r``."""
    eigenvalues, vectors = np.linalg.eigh(0.5 * (normal + normal.T))
    # Directions that leave every breakpoint where it is, up to rounding.
    roots = np.sqrt(np.where(eigenvalues > 1e-14 * max(eigenvalues[-1], 0.0), eigenvalues, 0.0))
    along = np.where(roots > 0, vectors.T @ gradient / np.where(roots > 0, roots, 1.0), 0.0)
    rest = np.sqrt(max(square - float(along @ along), 0.0))
    jacobian = np.vstack([roots[:, None] * vectors.T, np.zeros(len(roots))])
    return _Linearised(np.append(along, rest), jacobian)
