"""The linear parameters of a model for given partitions: one interface, with and without a rigid body underneath."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.least_squares import LeastSquares, solve

NO_RIGID_BODY = np.zeros(6)


@dataclass(frozen=True)
class Fit:
    """Linear parameters of a model, and the problem whose solution they are.

    Attributes
    ----------
    coefficients : array, shape (parameters,), kg m^2
        Of the fuzzy inertia functions.
    rigid_body : array, shape (6,), kg m^2
        Inertia parameters under them; zero without a rigid-body base.
    ridge_weight : float
        0 without a ridge; infinite where the fuzzy part is off.
    mean_squared_error : float
        What the solver minimised, on the samples it learned from: of the torque in (N m)^2, or cross-validated and
        scaled by axis for a rigid-body base.
    system : LeastSquares
        The solved system.
    row_scale : array, shape (3,), 1/(N m)
        What the rows of each axis were multiplied with.
    column_size : array, shape (parameters,)
        What the columns were divided by before the ridge held their coefficients; 1 without a ridge.
    """

    coefficients: Array
    rigid_body: Array
    ridge_weight: float
    mean_squared_error: float
    system: LeastSquares
    row_scale: Array
    column_size: Array


class CoefficientSolver(Protocol):
    """Finds the linear parameters for a regressor."""

    def fit(self, Q: Array) -> Fit:
        """Solve for the linear parameters and judge them.

        Parameters
        ----------
        Q : array, shape (samples, 3, parameters)

        Returns
        -------
        Fit
        """
        ...

    def refit(self, Q: Array, start: Fit) -> Fit:
        """Solve again with the hyperparameters of an earlier fit, for a local search.

        Parameters
        ----------
        Q : array, shape (samples, 3, parameters)
        start : Fit

        Returns
        -------
        Fit
        """
        ...


@dataclass(frozen=True)
class PlainSolver:
    """The paper's: all torque from the fuzzy inertia functions, minimum-norm least squares.

    Attributes
    ----------
    torque : array, shape (samples, 3), N m
    rank_tolerance : float
    """

    torque: Array
    rank_tolerance: float

    def fit(self, Q: Array) -> Fit:
        """Solve for the coefficients; see `CoefficientSolver.fit`."""
        system = solve(Q.reshape(-1, Q.shape[2]), self.torque.reshape(-1), self.rank_tolerance)
        mean_squared = float(np.mean(system.residual**2))
        unscaled = np.ones(3), np.ones(Q.shape[2])
        return Fit(system.coefficients, NO_RIGID_BODY, 0.0, mean_squared, system, *unscaled)

    def refit(self, Q: Array, start: Fit) -> Fit:  # noqa: ARG002 - there are no hyperparameters to keep
        """Solve for the coefficients; see `CoefficientSolver.refit`."""
        return self.fit(Q)
