"""Local search: partition weights refined by variable projection, the coefficients eliminated."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares

from cpfls_cli.arrays import Array
from cpfls_cli.identification.chromosome import decode, weight_jacobian
from cpfls_cli.identification.fit import CoefficientSolver, Fit
from cpfls_cli.regressor.sensitivity import torque_sensitivity


@dataclass
class _ReducedProblem:
    """Residual and Jacobian of the weights with the coefficients solved for, each point computed once."""

    solver: CoefficientSolver
    start: Fit
    _point: Array = field(default_factory=lambda: np.empty(0))
    _fit: Fit | None = None

    def residual(self, weights: Array) -> Array:
        return self._at(weights).system.residual

    def jacobian(self, weights: Array) -> Array:
        """Kaufman's approximation: the derivative of the fit, projected off what the regressor spans."""
        fit = self._at(weights)
        regressor = self.solver.regressor
        moved = torque_sensitivity(regressor, decode(regressor.structure, weights), fit.coefficients)
        by_weight = weight_jacobian(regressor.structure, weights, moved) * fit.row_scale[:, None]
        rows = np.zeros((len(fit.system.residual), by_weight.shape[2]))
        rows[: by_weight.shape[0] * 3] = by_weight.reshape(-1, by_weight.shape[2])
        return -fit.system.reject(rows)

    def _at(self, weights: Array) -> Fit:
        if self._fit is None or not np.array_equal(weights, self._point):
            self._fit = self.solver.refit(decode(self.solver.regressor.structure, weights), self.start)
            self._point = weights.copy()
        return self._fit


def refine(solver: CoefficientSolver, weights: Array, start: Fit, evaluations: int) -> Array:
    """Refine partition weights by nonlinear least squares with the coefficients eliminated.

    Parameters
    ----------
    solver : CoefficientSolver
    weights : array, shape (genes,)
        On [0, 1], no partition all zero.
    start : Fit
        The fit at these weights.
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
