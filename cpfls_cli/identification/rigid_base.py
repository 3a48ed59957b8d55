"""Linear parameters with a rigid body underneath: torque is rigid(I) + fuzzy(c), c under a cross-validated ridge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.cross_validation import RIGID, Blocks, RidgeCurve, contiguous_blocks, ridge_curve
from cpfls_cli.identification.data import TorqueData, axis_scale
from cpfls_cli.identification.fit import Fit
from cpfls_cli.identification.least_squares import solve
from cpfls_cli.identification.settings import RidgeSettings
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.vehicle.rigid_body import rigid_body_regressor


@dataclass(frozen=True)
class RigidBaseSolver:
    """Solves for six inertia parameters, free, and fuzzy coefficients, under a ridge.

    Attributes
    ----------
    rigid : array, shape (samples, 3, 6)
        Rigid-body columns, rows scaled by axis.
    torque : array, shape (samples, 3)
        Torque, rows scaled by axis.
    row_scale : array, shape (3,), 1/(N m)
    blocks : Blocks
    weights : array, shape (tried,)
        Ridge weights to try.
    rank_tolerance : float
    """

    rigid: Array
    torque: Array
    row_scale: Array
    blocks: Blocks
    weights: Array
    rank_tolerance: float

    @classmethod
    def of(cls, data: TorqueData, ridge: RidgeSettings, rank_tolerance: float) -> RigidBaseSolver:
        """Prepare the solver for training data.

        Parameters
        ----------
        data : TorqueData
        ridge : RidgeSettings
        rank_tolerance : float

        Returns
        -------
        RigidBaseSolver
        """
        scale = 1.0 / axis_scale(data.torque)
        weights = np.geomspace(ridge.smallest, ridge.largest, ridge.count)
        blocks = contiguous_blocks(data.time, ridge.folds, ridge.embargo_s)
        rigid = rigid_columns(data.motion) * scale[:, None]
        return cls(rigid, data.torque * scale, scale, blocks, weights, rank_tolerance)

    def fit(self, Q: Array) -> Fit:
        """Choose the ridge weight and solve; see `CoefficientSolver.fit`."""
        curve = self.curve(Q)
        size = column_size(Q * self.row_scale[:, None])
        return self._solve(Q, size, float(curve.weight[curve.chosen]), float(curve.error[curve.chosen]))

    def refit(self, Q: Array, start: Fit) -> Fit:
        """Solve with the ridge weight and column sizes of an earlier fit; see `CoefficientSolver.refit`.

        A penalty that moved with the columns would add a term to the gradient that variable projection leaves out.
        """
        return self._solve(Q, start.column_size, start.ridge_weight, start.mean_squared_error)

    def curve(self, Q: Array) -> RidgeCurve:
        """Cross-validate the ridge weight.

        Parameters
        ----------
        Q : array, shape (samples, 3, parameters)

        Returns
        -------
        RidgeCurve
        """
        scaled = Q * self.row_scale[:, None]
        rows = np.concatenate([self.rigid, scaled / column_size(scaled)], axis=2)
        return ridge_curve(rows, self.torque, self.blocks, self.weights)

    def _solve(self, Q: Array, size: Array, ridge_weight: float, cross_validated: float) -> Fit:
        """Solve the augmented system in full precision."""
        parameters = Q.shape[2]
        if np.isinf(ridge_weight):
            system = solve(self.rigid.reshape(-1, RIGID), self.torque.reshape(-1), self.rank_tolerance)
            rigid_body, coefficients = system.coefficients, np.zeros(parameters)
        else:
            scaled = Q * self.row_scale[:, None] / size
            matrix = np.concatenate([self.rigid, scaled], axis=2).reshape(-1, RIGID + parameters)
            penalty = np.sqrt(ridge_weight * len(matrix)) * np.eye(parameters, RIGID + parameters, RIGID)
            right_side = np.concatenate([self.torque.reshape(-1), np.zeros(parameters)])
            system = solve(np.vstack([matrix, penalty]), right_side, self.rank_tolerance)
            rigid_body, coefficients = system.coefficients[:RIGID], system.coefficients[RIGID:] / size
        return Fit(coefficients, rigid_body, ridge_weight, cross_validated, system, self.row_scale, size)


def rigid_columns(motion: Motion) -> Array:
    """Columns of the six inertia parameters Ixx, Iyy, Izz, Ixy, Ixz, Iyz in the generalised torque.

    Parameters
    ----------
    motion : Motion

    Returns
    -------
    array, shape (samples, 3, 6)
    """
    return rigid_body_regressor(motion.attitude, motion.rate, motion.acceleration)


def column_size(rows: Array) -> Array:
    """Root mean square of columns; 1 for columns of zeros.

    Parameters
    ----------
    rows : array, shape (samples, 3, columns)

    Returns
    -------
    array, shape (columns,)
    """
    size = np.sqrt(np.mean(rows**2, axis=(0, 1)))
    return np.where(size > 0, size, 1.0)
