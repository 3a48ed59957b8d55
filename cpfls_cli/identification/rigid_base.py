"""Linear parameters with a rigid body underneath: torque is rigid(I) + fuzzy(c), c under a cross-validated ridge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.cross_validation import RIGID, Blocks, RidgeCurve, Rows, contiguous_blocks, ridge_curve
from cpfls_cli.identification.data import TorqueData, axis_scale
from cpfls_cli.identification.fit import Fit, usable
from cpfls_cli.identification.least_squares import LeastSquares, solve
from cpfls_cli.identification.settings import RidgeSettings
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import Breakpoints, Regressor
from cpfls_cli.vehicle.rigid_body import rigid_body_regressor


@dataclass(frozen=True)
class ScaledData:
    """Samples with their rows divided by the size of the torque about each axis.

    Attributes
    ----------
    regressor : Regressor
    rigid : array, shape (samples, 3, 6)
        Rigid-body columns.
    torque : array, shape (samples, 3)
    row_scale : array, shape (3,), 1/(N m)
    """

    regressor: Regressor
    rigid: Array
    torque: Array
    row_scale: Array

    @classmethod
    def of(cls, regressor: Regressor, torque: Array, row_scale: Array) -> ScaledData:
        """Scale the samples of a regressor and their torque."""
        return cls(regressor, rigid_columns(regressor.motion) * row_scale[:, None], torque * row_scale, row_scale)

    def fuzzy(self, partitions: Breakpoints) -> Array:
        """Build the scaled fuzzy columns, shape (samples, 3, parameters)."""
        return self.regressor.matrix(partitions) * self.row_scale[:, None]

    def rows(self, fuzzy: Array, size: Array) -> Rows:
        """Join rigid-body columns and fuzzy columns divided by their size."""
        return Rows(np.concatenate([self.rigid, fuzzy / size], axis=2), self.torque)


@dataclass(frozen=True)
class RigidBaseSolver:
    """Solves for six inertia parameters, free, and fuzzy coefficients, under a ridge.

    Attributes
    ----------
    learned : ScaledData
        The samples that parameters are learned from.
    judged : ScaledData
        The whole training part, which judges ridge weights block by block.
    blocks : Blocks
    weights : array, shape (tried,)
        Ridge weights to try.
    rank_tolerance : float
    """

    learned: ScaledData
    judged: ScaledData
    blocks: Blocks
    weights: Array
    rank_tolerance: float

    @classmethod
    def of(
        cls,
        learned: tuple[TorqueData, Regressor],
        training: tuple[TorqueData, Regressor],
        ridge: RidgeSettings,
        rank_tolerance: float,
    ) -> RigidBaseSolver:
        """Prepare the solver.

        Parameters
        ----------
        learned, training : tuple of TorqueData and Regressor
            The samples that parameters are learned from, and the whole training part.
        ridge : RidgeSettings
        rank_tolerance : float

        Returns
        -------
        RigidBaseSolver
        """
        scale = 1.0 / axis_scale(learned[0].torque)
        weights = np.geomspace(ridge.smallest, ridge.largest, ridge.count)
        blocks = contiguous_blocks(training[0].time, learned[0].time, ridge.folds, ridge.embargo_s)
        teachers, judges = (ScaledData.of(regressor, part.torque, scale) for part, regressor in (learned, training))
        return cls(teachers, judges, blocks, weights, rank_tolerance)

    @property
    def regressor(self) -> Regressor:
        """Regressor of the samples that parameters are learned from."""
        return self.learned.regressor

    def fit(self, partitions: Breakpoints) -> Fit | None:
        """Choose the ridge weight and solve; see `CoefficientSolver.fit`."""
        fuzzy = self.learned.fuzzy(partitions)
        if not usable(fuzzy):
            return None
        curve = self.curve(partitions)
        return self._solve(fuzzy, column_size(fuzzy), float(curve.weight[curve.chosen]), curve.error[curve.chosen])

    def refit(self, partitions: Breakpoints, start: Fit) -> Fit:
        """Solve with the ridge weight and column sizes of an earlier fit; see `CoefficientSolver.refit`.

        A penalty that moved with the columns would add a term to the gradient that variable projection leaves out.
        """
        fuzzy = self.learned.fuzzy(partitions)
        return self._solve(fuzzy, start.column_size, start.ridge_weight, start.mean_squared_error)

    def unpenalised(self, partitions: Breakpoints, fit: Fit) -> LeastSquares:
        """Decompose the rigid columns, and the fuzzy ones where they are on; see `CoefficientSolver.unpenalised`."""
        if np.isinf(fit.ridge_weight):
            return fit.system
        rows = self.learned.rows(self.learned.fuzzy(partitions), fit.column_size)
        matrix = rows.matrix.reshape(-1, rows.matrix.shape[2])
        return solve(matrix, rows.right_side.reshape(-1), self.rank_tolerance)

    def curve(self, partitions: Breakpoints) -> RidgeCurve:
        """Cross-validate the ridge weight.

        Parameters
        ----------
        partitions : sequence of array, shape (functions,)

        Returns
        -------
        RidgeCurve
        """
        fuzzy = self.learned.fuzzy(partitions)
        size = column_size(fuzzy)
        learned = self.learned.rows(fuzzy, size)
        same = self.judged.regressor is self.learned.regressor
        judged = learned if same else self.judged.rows(self.judged.fuzzy(partitions), size)
        return ridge_curve(learned, judged, self.blocks, self.weights)

    def _solve(self, fuzzy: Array, size: Array, ridge_weight: float, cross_validated: float) -> Fit:
        """Solve the augmented system in full precision."""
        parameters, torque = fuzzy.shape[2], self.learned.torque
        if np.isinf(ridge_weight):
            system = solve(self.learned.rigid.reshape(-1, RIGID), torque.reshape(-1), self.rank_tolerance)
            rigid_body, coefficients = system.coefficients, np.zeros(parameters)
        else:
            matrix = self.learned.rows(fuzzy, size).matrix.reshape(-1, RIGID + parameters)
            penalty = np.sqrt(ridge_weight * len(matrix)) * np.eye(parameters, RIGID + parameters, RIGID)
            right_side = np.concatenate([torque.reshape(-1), np.zeros(parameters)])
            system = solve(np.vstack([matrix, penalty]), right_side, self.rank_tolerance)
            rigid_body, coefficients = system.coefficients[:RIGID], system.coefficients[RIGID:] / size
        row_scale = self.learned.row_scale
        return Fit(coefficients, rigid_body, ridge_weight, float(cross_validated), system, row_scale, size)


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
