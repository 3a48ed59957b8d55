"""Reduce a training set to the samples worth learning from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.reduction.criteria import make_criterion
from cpfls_cli.reduction.rank_start import rank_growing_start
from cpfls_cli.reduction.row_space import RowSpace, row_space
from cpfls_cli.reduction.run import Run
from cpfls_cli.reduction.selection import Selection, StopReason
from cpfls_cli.reduction.settings import CriterionName, ReductionSettings

Progress = Callable[[int, int], None]


def reduce(Q: Array, settings: ReductionSettings, progress: Progress | None = None) -> Selection:
    """Choose samples one by one, each the best next one by the criterion.

    All criteria but the printed rule begin with the fewest samples that reach the full rank. Where all samples
    together are rank deficient, the selection works in their row space.

    Parameters
    ----------
    Q : array, shape (samples, 3, parameters)
        Regressor, three rows per sample.
    settings : ReductionSettings
    progress : callable, optional
        Called with the samples chosen and the most there can be.

    Returns
    -------
    Selection

    Raises
    ------
    ComputationError
        If Q has the wrong shape or a value that is not finite, or if the size is larger than the number of
        samples or too small for the rank.

    References
    ----------
    Paper, section 8, eq. (19); method.md, section 6.
    """
    space = row_space(Q, settings.rank_tolerance)
    limit = _sample_limit(space, settings)
    start = _start(space, settings.criterion, limit)
    run = Run(space, make_criterion(space, settings.criterion), start)
    while not (reason := _stop_reason(run, settings, limit)):
        run.step()
        if progress is not None:
            progress(len(run.indices), limit)
    return run.selection(settings.criterion, reason)


def _sample_limit(space: RowSpace, settings: ReductionSettings) -> int:
    size = settings.size
    if size is None:
        return space.samples
    if size > space.samples:
        raise ComputationError(f"size = {size}: larger than the training set, which has {space.samples} samples")
    if size < space.smallest_samples:
        raise ComputationError(
            f"size = {size}: too few samples; the training set has rank {space.rank}, "
            f"which takes at least {space.smallest_samples} samples of three rows"
        )
    return size


def _start(space: RowSpace, criterion: CriterionName, limit: int) -> IntArray:
    if criterion == "paper-literal":
        return np.zeros(0, dtype=np.int64)
    start = rank_growing_start(space)
    if len(start) > limit:
        raise ComputationError(
            f"size = {limit}: too few samples; the selection needs {len(start)} to reach "
            f"rank {space.rank}, the rank of the training set"
        )
    return start


def _stop_reason(run: Run, settings: ReductionSettings, limit: int) -> StopReason | None:
    target = settings.condition_number
    if target is not None and run.indices and run.factor.condition_number <= target:
        return "condition-number"
    if len(run.indices) < limit:
        return None
    return "all-samples" if settings.size is None else "size"
