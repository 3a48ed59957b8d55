"""Reduce a training set to the samples worth learning from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import SettingError
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
        If Q has the wrong shape or a value that is not finite, or is zero everywhere.
    SettingError
        If the size is larger than the number of samples or too small for the rank.

    References
    ----------
    Paper, section 8, eq. (19); method.md, section 6.
    """
    return choose(row_space(Q, settings.rank_tolerance), settings, progress)


def check_reducible(Q: Array, settings: ReductionSettings) -> None:
    """Refuse what `reduce` would refuse, without the work of choosing.

    Parameters
    ----------
    Q : array, shape (samples, 3, parameters)
    settings : ReductionSettings

    Raises
    ------
    ComputationError, SettingError
        See `reduce`.
    """
    check_space(row_space(Q, settings.rank_tolerance), settings)


def choose(space: RowSpace, settings: ReductionSettings, progress: Progress | None = None) -> Selection:
    """Choose samples of a row space as `reduce` does.

    Parameters
    ----------
    space : RowSpace
    settings : ReductionSettings
    progress : callable, optional

    Returns
    -------
    Selection

    Raises
    ------
    SettingError
        See `reduce`.
    """
    run, limit = _prepare(space, settings)
    while not (reason := _stop_reason(run, settings, limit)):
        run.step()
        if progress is not None:
            progress(len(run.indices), limit)
    return run.selection(settings.criterion, reason)


def check_space(space: RowSpace, settings: ReductionSettings) -> None:
    """Refuse what `choose` would refuse, without the work of choosing.

    Parameters
    ----------
    space : RowSpace
    settings : ReductionSettings

    Raises
    ------
    SettingError
        See `reduce`.
    """
    _prepare(space, settings)


def _prepare(space: RowSpace, settings: ReductionSettings) -> tuple[Run, int]:
    """Set up a run and the most samples it may choose."""
    limit = _sample_limit(space, settings)
    start = _start(space, settings.criterion, limit)
    return Run(space, make_criterion(space, settings.criterion), start), limit


def _sample_limit(space: RowSpace, settings: ReductionSettings) -> int:
    size = settings.size
    if size is None:
        return space.samples
    if size > space.samples:
        raise SettingError("size", f"the training set has only {space.samples} samples; keep fewer")
    if size < space.smallest_samples:
        raise _too_few(space, space.smallest_samples)
    return size


def _start(space: RowSpace, criterion: CriterionName, limit: int) -> IntArray:
    if criterion == "paper-literal":
        return np.zeros(0, dtype=np.int64)
    start = rank_growing_start(space)
    if len(start) > limit:
        raise _too_few(space, len(start))
    return start


def _too_few(space: RowSpace, needed: int) -> SettingError:
    return SettingError("size", f"the training set has rank {space.rank}, which takes {needed} samples or more")


def _stop_reason(run: Run, settings: ReductionSettings, limit: int) -> StopReason | None:
    target = settings.condition_number
    if target is not None and run.indices and run.factor.condition_number <= target:
        return "condition-number"
    if len(run.indices) < limit:
        return None
    return "all-samples" if settings.size is None else "size"
