"""The linear parameters of a model for given partitions, by cross-validation where they are regularised."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import linalg

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import contiguous, mean_error
from cpfls_cli.dynamics import rigid_columns
from cpfls_cli.errors import SettingError
from cpfls_cli.identification.data import TorqueData, sample_times
from cpfls_cli.identification.samples import Products, Samples
from cpfls_cli.identification.settings import RidgeSettings
from cpfls_cli.least_squares import LeastSquares, NormalEquations, Project, Triangle, solve_normal
from cpfls_cli.regressor.regressor import RIGID, Breakpoints, Regressor
from cpfls_cli.result import about
from cpfls_cli.rounding import at_most, levelled

SMALLEST_ERROR = 1e-12
"""Share of the mean squared torque below which sums of products cannot resolve errors."""


@dataclass(frozen=True)
class Blocks:
    """Contiguous blocks of a flight for cross-validation.

    `validation`: samples judged in each fold; `left_out`: samples that do not train in it, those within the block's
    time, and within the embargo around it.
    """

    validation: BoolArray
    left_out: BoolArray


@dataclass(frozen=True, eq=False)
class RidgeCurve:
    """Cross-validated error over the ridge weight."""

    weight: Array = about("ridge weights tried; the last is infinite: the fuzzy part is off", "tried", gaps=True)
    error: Array = about("cross-validated error of the scaled torque", "tried")
    standard_error: Array = about("its standard error over blocks", "tried")
    chosen: int = about("index of the largest weight within one standard error of the least error")


def contiguous_blocks(judged: Array, learned: Array, folds: int, embargo: float) -> Blocks:
    """Cut a flight into contiguous blocks of equal numbers of judged samples, by ascending times in s.

    Samples learned from are the same, or a selection of them; those within the embargo before and after a block do not
    train with it held out. `SettingError` where a block and its embargo leave no sample to train on.
    """
    folds = max(min(folds, len(judged)), 1)
    label = contiguous(len(judged), folds)
    validation = np.arange(folds)[:, None] == label
    spans = [(judged[block][0] - embargo, judged[block][-1] + embargo) for block in validation]
    left_out = np.array([(learned >= start) & (learned <= end) for start, end in spans])
    if left_out.all(axis=1).any():
        raise SettingError(
            "ridge.embargo_s",
            f"a block and {embargo:g} s on both sides cover all samples; lower it, or use more samples",
        )
    return Blocks(validation, left_out)


def ridge_curve(learned: Products, judged: Products, left_out: BoolArray, weights: Array, size: Array) -> RidgeCurve:
    """Cross-validate the ridge weight of the fuzzy columns, which stand after the six of the rigid body.

    The six rigid-body columns are free of penalty. For each fold they are eliminated (Schur complement), and one
    eigendecomposition of the rest serves all weights. Errors that differ by rounding alone count as equal.

    Parameters
    ----------
    learned : Products
        Of the samples that train, by label.
    judged : Products
        Of the samples that judge, by fold: all of the flight's training part, so that what a selection leaves between
        its samples is seen.
    left_out : array of bool, shape (folds, labels)
        Labels that do not train in each fold.
    weights : array, shape (tried,)
        Finite ridge weights, ascending, as shares of the number of rows.
    size : array, shape (parameters,)
        What the penalised columns are divided by.

    References
    ----------
    method.md section 8; Hastie, Tibshirani and Friedman, The Elements of Statistical Learning, section 7.10
    (one-standard-error rule).
    """
    folds = range(len(left_out))
    errors = np.array([_fold_errors(learned.sum(~left_out[fold]), judged, fold, weights, size) for fold in folds])
    mean = np.average(errors, axis=0, weights=judged.rows)
    spread = mean_error(errors) if len(errors) > 1 else np.zeros_like(mean)
    best = int(np.argmin(levelled(mean)))
    # The more ridge the safer: a fuzzy part must earn its place.
    chosen = int(np.flatnonzero(at_most(mean, mean[best] + spread[best]))[-1])
    return RidgeCurve(np.append(weights, np.inf), mean, spread, chosen)


def _fold_errors(learned: Products, judged: Products, fold: int, weights: Array, size: Array) -> Array:
    """Mean squared error on one block for every weight, the fuzzy part off last."""
    divide = np.concatenate([np.ones(RIGID), 1.0 / size])
    path = _ridge_path(
        learned.gram[0] * divide * divide[:, None], learned.moment[0] * divide, weights * learned.rows[0]
    )
    path = path * divide[:, None]
    explained = 2.0 * judged.moment[fold] @ path - np.einsum("pw,pw->w", path, judged.gram[fold] @ path)
    square, rows = judged.square[fold], judged.rows[fold]
    return np.asarray(np.maximum(square - explained, SMALLEST_ERROR * square) / rows)


def _ridge_path(gram: Array, moment: Array, weights: Array) -> Array:
    """Solve for all ridge weights, and for the fuzzy part off; shape (6 + parameters, weights + 1)."""
    free, held = slice(0, RIGID), slice(RIGID, None)
    eliminate = linalg.lstsq(gram[free, free], np.column_stack([gram[free, held], moment[free]]))[0]
    onto, alone = eliminate[:, :-1], eliminate[:, -1]
    values, vectors = linalg.eigh(gram[held, held] - gram[held, free] @ onto, check_finite=False)
    projected = vectors.T @ (moment[held] - gram[held, free] @ alone)
    fuzzy = vectors @ (projected[:, None] / (np.maximum(values, 0.0)[:, None] + weights))
    fuzzy = np.column_stack([fuzzy, np.zeros(len(fuzzy))])
    return np.vstack([alone[:, None] - onto @ fuzzy, fuzzy])


@dataclass(frozen=True)
class RidgeChoice:
    """Folds and candidates from which cross-validation chooses the ridge weight of a fuzzy part over a rigid body.

    Attributes
    ----------
    judged : Samples
        The whole training part, labelled by fold.
    left_out : array of bool, shape (folds, labels)
        Labels of the learned samples that do not train in each fold.
    weights : array, shape (tried,)
    """

    judged: Samples
    left_out: BoolArray
    weights: Array


def with_folds(learned: Samples, judged: Samples, settings: RidgeSettings) -> tuple[Samples, RidgeChoice]:
    """Label samples for the cross-validation of a ridge weight.

    Parameters
    ----------
    learned, judged : Samples
        The samples that parameters are learned from, and the whole training part.

    Returns
    -------
    learned : Samples
        Labelled by the folds in which they do not train.
    choice : RidgeChoice

    Raises
    ------
    SettingError
        If there are too few samples for the folds.
    """
    if len(learned.ready.source) < 2 * settings.folds:
        few = len(learned.ready.source)
        raise SettingError("ridge.folds", f"{few} samples are too few for that many blocks; use more samples")
    times = sample_times(judged.ready.source), sample_times(learned.ready.source)
    blocks = contiguous_blocks(*times, settings.folds, settings.embargo_s)
    fold, label, left_out = np.argmax(blocks.validation, axis=0), *_groups(blocks.left_out)
    choice = RidgeChoice(
        judged=replace(judged, label=fold, labels=len(blocks.validation)),
        left_out=left_out,
        weights=np.geomspace(settings.smallest, settings.largest, settings.count),
    )
    return replace(learned, label=label, labels=left_out.shape[1]), choice


def _groups(left_out: BoolArray) -> tuple[IntArray, BoolArray]:
    """Group samples that are left out in the same folds: their label, and what each label is left out of."""
    bits = np.arange(len(left_out))
    code = np.sum(left_out.astype(np.int64) << bits[:, None], axis=0)
    codes, label = np.unique(code, return_inverse=True)
    return label.astype(np.int64), (codes >> bits[:, None] & 1).astype(bool)


# Samples written out at a time: some 10 MB for 113 parameters.
_BLOCK = 4096
NO_RIGID_BODY = np.zeros(RIGID)
LARGEST_SQUARE = 1e200
"""Of a column, beyond which products of products overflow."""


@dataclass(frozen=True)
class Fit:
    """Linear parameters of a model, with the weights and the conditioning of their fit.

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
    conditioning : float
        Condition number of the system solved; one of smaller rank is always worse, and finite.
    row_scale : array, shape (3,), 1/(N m)
        What the rows of each axis were multiplied with.
    column_size : array, shape (parameters,)
        What the columns were divided by before the ridge held their coefficients; 1 without a ridge.
    """

    coefficients: Array
    rigid_body: Array
    ridge_weight: float
    mean_squared_error: float
    conditioning: float
    row_scale: Array
    column_size: Array


class Ridge(NamedTuple):
    """A ridge weight with the column sizes that it holds for, as in `Fit`, and its cross-validated error."""

    ridge_weight: float
    column_size: Array
    error: float | None


def regressor_blocks(learned: Samples) -> Iterator[tuple[TorqueData, Regressor]]:
    """Yield the samples block by block, small enough to write out, with their regressors."""
    for data in learned.ready.source.chunks():
        for start in range(0, len(data), _BLOCK):
            block = data[start : start + _BLOCK]
            yield block, Regressor(learned.structure, block.motion, learned.ranges)


def _rows(learned: Samples, partitions: Breakpoints, fit: Fit, *, fuzzy: bool) -> Iterator[tuple[Array, Array]]:
    for data, regressor in regressor_blocks(learned):
        columns = [rigid_columns(data.motion)] if learned.ready.rigid else []
        if fuzzy:
            columns.append(regressor.matrix(partitions) / fit.column_size)
        scaled = np.concatenate(columns, axis=2) * learned.scale[:, None]
        yield scaled.reshape(-1, scaled.shape[2]), (data.torque * learned.scale).reshape(-1)


@dataclass(frozen=True)
class Solver:
    """Solve for the fuzzy coefficients, alone as in the paper or with six free inertia parameters under them.

    Then `ridge` says how the ridge on the coefficients is chosen; alone there is none.
    """

    learned: Samples
    ridge: RidgeChoice | None
    rank_tolerance: float

    def products(self, partitions: Breakpoints) -> Products | None:
        """Add up the products of the columns; None where a partition is not defined or a column is not finite.

        A slope of a very narrow function can be beyond what squares can carry.
        """
        if not all(np.isfinite(part).all() for part in partitions):
            return None
        products = self.learned.products(partitions)
        return products if np.max(np.abs(products.gram)) <= LARGEST_SQUARE else None

    def fit(self, partitions: Breakpoints, products: Products | None = None, ridge: Ridge | None = None) -> Fit | None:
        """Solve for the linear parameters, with the ridge weight that these partitions need.

        Parameters
        ----------
        products : Products, optional
            Of these partitions, where they are known already.
        ridge : Ridge, optional
            The same of its ridge.

        Returns
        -------
        Fit or None
            None where the regressor is not finite.
        """
        products = products or self.products(partitions)
        if products is None:
            return None
        return self._solved(products.sum(), partitions, *(ridge or self.ridge_of(partitions, products)))

    def ridge_of(self, partitions: Breakpoints, products: Products) -> Ridge:
        """Cross-validate the ridge weight that partitions need, whose products are given; 0 without a ridge."""
        if self.ridge is None:
            return Ridge(0.0, np.ones(self.learned.table.parameters), None)
        size = column_size(products.sum())
        curve = self._curve(products, partitions, size)
        return Ridge(float(curve.weight[curve.chosen]), size, float(curve.error[curve.chosen]))

    def curve(self, partitions: Breakpoints) -> RidgeCurve | None:
        """Cross-validate the ridge weight.

        Returns
        -------
        RidgeCurve or None
            None without a ridge.
        """
        products = self.learned.products(partitions)
        return None if self.ridge is None else self._curve(products, partitions, column_size(products.sum()))

    def equations(self, products: Products, weight: float, size: Array) -> NormalEquations:
        """Set up the equations for a given ridge.

        Parameters
        ----------
        products : Products
            Under one label.
        weight : float
            Finite.
        size : array, shape (parameters,)
            What the columns of the fuzzy part are divided by.
        """
        divide = self._divide(size)
        penalty = np.full(len(divide), weight * products.rows[0])
        penalty[: len(divide) - len(size)] = 0.0
        return NormalEquations(products.gram[0] / (divide * divide[:, None]), products.moment[0] / divide, penalty)

    def parameters(self, solution: Array, size: Array) -> tuple[Array, Array]:
        """Split a solution of the equations into fuzzy coefficients and rigid body."""
        if self.ridge is None:
            return solution / size, NO_RIGID_BODY
        return solution[RIGID:] / size, solution[:RIGID]

    def exact(self, partitions: Breakpoints, fit: Fit) -> tuple[Fit, LeastSquares]:
        """Solve again by a singular value decomposition of all rows, at ridge and sizes of a fit.

        Parameters
        ----------
        fit : Fit
            Gives the ridge.

        Returns
        -------
        fit : Fit
        unpenalised : LeastSquares
            Of the parameters in use, without any penalty: what the data determine.
        """
        rigid, off = self.learned.ready.rigid, np.isinf(fit.ridge_weight)
        triangle = Triangle.of(_rows(self.learned, partitions, fit, fuzzy=not off))
        unpenalised = triangle.solve(self.rank_tolerance)
        if off:
            return replace(fit, rigid_body=unpenalised.coefficients), unpenalised
        parameters, rows = self.learned.structure.parameters, 3 * len(self.learned.ready.source)
        if not rigid:
            # Sums of products leave only rounding of an error far below the torque.
            error = triangle.square(unpenalised.coefficients) / rows
            return replace(fit, coefficients=unpenalised.coefficients, mean_squared_error=error), unpenalised
        penalty = np.sqrt(fit.ridge_weight * rows) * np.eye(parameters, RIGID + parameters, RIGID)
        penalised = triangle.below(penalty).solve(self.rank_tolerance).coefficients
        return replace(fit, coefficients=penalised[RIGID:] / fit.column_size, rigid_body=penalised[:RIGID]), unpenalised

    def _curve(self, products: Products, partitions: Breakpoints, size: Array) -> RidgeCurve:
        assert self.ridge is not None
        judged = self.ridge.judged.products(partitions)
        return ridge_curve(products, judged, self.ridge.left_out, self.ridge.weights, size)

    def _solved(
        self, products: Products, partitions: Breakpoints, weight: float, size: Array, error: float | None
    ) -> Fit:
        """Solve the equations; without a ridge the error is that of the solution itself."""
        scale, divide = self.learned.scale, self._divide(size)

        def project(parameters: Array, directions: Array) -> tuple[Array, Array]:
            square, back = self.learned.projected(partitions, parameters / divide, directions / divide[:, None])
            return square, back / divide

        if np.isinf(weight):
            rigid = NormalEquations(products.gram[0, :RIGID, :RIGID], products.moment[0, :RIGID], np.zeros(RIGID))
            solution = solve_normal(rigid, self.rank_tolerance, _of_rigid_body(project, len(size)))
            coefficients, rigid_body = np.zeros_like(size), solution.parameters
        else:
            equations = self.equations(products, weight, size)
            solution = solve_normal(equations, self.rank_tolerance, project)
            coefficients, rigid_body = self.parameters(solution.parameters, size)
            if error is None:
                error = float((products.square[0] - equations.moment @ solution.parameters) / products.rows[0])
        return Fit(coefficients, rigid_body, weight, max(error or 0.0, 0.0), solution.conditioning, scale, size)

    def _divide(self, size: Array) -> Array:
        return size if self.ridge is None else np.concatenate([np.ones(RIGID), size])


def column_size(products: Products) -> Array:
    """Compute the root mean square of the fuzzy columns; 1 for columns of zeros.

    Parameters
    ----------
    products : Products
        Of columns with a rigid body before them.

    Returns
    -------
    array, shape (parameters,)
    """
    size = np.sqrt(np.diag(products.gram[0])[RIGID:] / products.rows[0])
    return np.where(size > 0, size, 1.0)


def _of_rigid_body(project: Project, parameters: int) -> Project:
    """Restrict products to the columns of the rigid body, which come first."""

    def projected(rigid_body: Array, directions: Array) -> tuple[Array, Array]:
        below = np.zeros((parameters, directions.shape[1]))
        square, back = project(np.append(rigid_body, below[:, 0]), np.vstack([directions, below]))
        return square, back[:RIGID]

    return projected
