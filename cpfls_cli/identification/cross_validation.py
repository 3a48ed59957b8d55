"""The ridge weight of the fuzzy part by blocked cross-validation, from Gram matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import ComputationError

RIGID = 6


@dataclass(frozen=True)
class Blocks:
    """Contiguous blocks of samples for cross-validation.

    Attributes
    ----------
    validation : array of bool, shape (folds, samples)
        Samples judged in each fold.
    left_out : array of bool, shape (folds, samples)
        Samples that do not train in each fold: those judged, and those within the embargo around them.
    """

    validation: BoolArray
    left_out: BoolArray


@dataclass(frozen=True)
class RidgeCurve:
    """Cross-validated error over the ridge weight.

    Attributes
    ----------
    weight : array, shape (tried,)
        Ascending; the last is infinite: the fuzzy part is off.
    error : array, shape (tried,)
        Mean squared error of the scaled torque over all blocks.
    standard_error : array, shape (tried,)
        Of the mean over blocks.
    chosen : int
        The largest weight whose error lies within one standard error of the smallest.
    """

    weight: Array
    error: Array
    standard_error: Array
    chosen: int


def contiguous_blocks(time: Array, folds: int, embargo: float) -> Blocks:
    """Cut samples into contiguous blocks of equal numbers.

    Parameters
    ----------
    time : array, shape (samples,), s
        Ascending.
    folds : int
    embargo : float
        Seconds before and after a block that do not train with it held out.

    Returns
    -------
    Blocks
    """
    folds = max(min(folds, len(time)), 1)
    label: IntArray = np.arange(len(time)) * folds // max(len(time), 1)
    validation = np.arange(folds)[:, None] == label
    spans = [(time[block][0] - embargo, time[block][-1] + embargo) for block in validation]
    left_out = np.array([(time >= start) & (time <= end) for start, end in spans])
    return Blocks(validation, left_out)


def ridge_curve(rows: Array, right_side: Array, blocks: Blocks, weights: Array) -> RidgeCurve:
    """Cross-validate the ridge weight on the columns after the first six.

    The six rigid-body columns are free of penalty. For each fold they are eliminated (Schur complement), and one
    eigendecomposition of the rest serves all weights.

    Parameters
    ----------
    rows : array, shape (samples, 3, 6 + parameters)
        Rigid-body columns, then fuzzy columns scaled to equal size; rows scaled by axis.
    right_side : array, shape (samples, 3)
        Scaled torque.
    blocks : Blocks
    weights : array, shape (tried,)
        Finite ridge weights, ascending, as shares of the number of rows.

    Returns
    -------
    RidgeCurve

    Raises
    ------
    ComputationError
        If a block and its embargo leave no sample to train on.

    References
    ----------
    method.md section 8; Hastie, Tibshirani and Friedman, The Elements of Statistical Learning, section 7.10
    (one-standard-error rule).
    """
    if blocks.left_out.all(axis=1).any():
        raise ComputationError(
            "a block of the cross-validation and its embargo cover all samples; use more samples, or lower "
            "identification.ridge.embargo_s"
        )
    errors = np.array([_fold_errors(rows, right_side, blocks, fold, weights) for fold in range(len(blocks.validation))])
    samples = np.sum(blocks.validation, axis=1)
    mean = np.average(errors, axis=0, weights=samples)
    spread = np.std(errors, axis=0, ddof=1) / np.sqrt(len(errors)) if len(errors) > 1 else np.zeros_like(mean)
    best = int(np.argmin(mean))
    # The more ridge the safer: a fuzzy part must earn its place.
    chosen = int(np.flatnonzero(mean <= mean[best] + spread[best])[-1])
    return RidgeCurve(np.append(weights, np.inf), mean, spread, chosen)


def _fold_errors(rows: Array, right_side: Array, blocks: Blocks, fold: int, weights: Array) -> Array:
    """Mean squared error on one block for every weight, the fuzzy part off last."""
    train = ~blocks.left_out[fold]
    A, y = rows[train].reshape(-1, rows.shape[2]), right_side[train].reshape(-1)
    V, z = (a[blocks.validation[fold]] for a in (rows, right_side))
    coefficients = _ridge_path(A.T @ A, A.T @ y, weights * len(y))
    residual = z.reshape(-1)[:, None] - V.reshape(-1, V.shape[2]) @ coefficients
    return np.asarray(np.mean(residual**2, axis=0))


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
