"""The ridge weight of the fuzzy part by blocked cross-validation, from Gram matrices."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import contiguous, mean_error
from cpfls_cli.errors import SettingError
from cpfls_cli.identification.data import sample_times
from cpfls_cli.identification.samples import Products, Samples
from cpfls_cli.identification.settings import RidgeSettings
from cpfls_cli.regressor.motion import RIGID
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
