"""Blocks of the training part that judge a ridge weight in turn, as labels of samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cpfls_cli.arrays import BoolArray, IntArray
from cpfls_cli.errors import SettingError
from cpfls_cli.identification.cross_validation import contiguous_blocks
from cpfls_cli.identification.data import sample_times
from cpfls_cli.identification.samples import Samples
from cpfls_cli.identification.settings import RidgeSettings
from cpfls_cli.identification.solver import RidgeChoice


def with_folds(learned: Samples, judged: Samples, settings: RidgeSettings) -> tuple[Samples, RidgeChoice]:
    """Label samples for the cross-validation of a ridge weight.

    Parameters
    ----------
    learned, judged : Samples
        The samples that parameters are learned from, and the whole training part.
    settings : RidgeSettings

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
