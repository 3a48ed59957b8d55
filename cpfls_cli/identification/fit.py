"""The linear parameters of a model for given partitions: one interface, with and without a rigid body underneath."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.least_squares import LeastSquares, solve
from cpfls_cli.regressor.regressor import Breakpoints, Regressor

NO_RIGID_BODY = np.zeros(6)
LARGEST_ENTRY = 1e100


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
    """Finds the linear parameters of a model for given partitions."""

    @property
    def regressor(self) -> Regressor:
        """Regressor of the samples that parameters are learned from."""
        ...

    def fit(self, partitions: Breakpoints) -> Fit | None:
        """Solve for the linear parameters.

        Parameters
        ----------
        partitions : sequence of array, shape (functions,)

        Returns
        -------
        Fit or None
            None where the regressor is not finite.
        """
        ...

    def refit(self, partitions: Breakpoints, start: Fit) -> Fit:
        """Solve again with the hyperparameters of an earlier fit, for a local search.

        Parameters
        ----------
        partitions : sequence of array, shape (functions,)
        start : Fit

        Returns
        -------
        Fit
        """
        ...

    def unpenalised(self, partitions: Breakpoints, fit: Fit) -> LeastSquares:
        """Decompose the regressor of the parameters that a fit uses, without any penalty: what the data determine.

        Parameters
        ----------
        partitions : sequence of array, shape (functions,)
        fit : Fit

        Returns
        -------
        LeastSquares
        """
        ...


@dataclass(frozen=True)
class PlainSolver:
    """The paper's: all torque from the fuzzy inertia functions, minimum-norm least squares.

    Attributes
    ----------
    regressor : Regressor
    torque : array, shape (samples, 3), N m
    rank_tolerance : float
    """

    regressor: Regressor
    torque: Array
    rank_tolerance: float

    def fit(self, partitions: Breakpoints) -> Fit | None:
        """Solve for the coefficients; see `CoefficientSolver.fit`."""
        Q = self.regressor.matrix(partitions)
        return self._solve(Q) if usable(Q) else None

    def refit(self, partitions: Breakpoints, start: Fit) -> Fit:  # noqa: ARG002 - there are no hyperparameters to keep
        """Solve for the coefficients; see `CoefficientSolver.refit`."""
        return self._solve(self.regressor.matrix(partitions))

    def unpenalised(self, partitions: Breakpoints, fit: Fit) -> LeastSquares:  # noqa: ARG002 - the fit has no penalty
        """Give the solved system; see `CoefficientSolver.unpenalised`."""
        return fit.system

    def _solve(self, Q: Array) -> Fit:
        system = solve(Q.reshape(-1, Q.shape[2]), self.torque.reshape(-1), self.rank_tolerance)
        mean_squared = float(np.mean(system.residual**2))
        unscaled = np.ones(3), np.ones(Q.shape[2])
        return Fit(system.coefficients, NO_RIGID_BODY, 0.0, mean_squared, system, *unscaled)


def usable(Q: Array) -> bool:
    """Tell whether a regressor can be decomposed.

    Parameters
    ----------
    Q : array, shape (samples, 3, parameters)

    Returns
    -------
    bool
        False where it is not finite, or a very narrow function has slopes beyond what a decomposition can carry.
    """
    return bool(np.isfinite(Q).all() and np.max(np.abs(Q)) <= LARGEST_ENTRY)
