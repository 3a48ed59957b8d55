"""Where a selection begins and where it ends."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.errors import SettingError
from cpfls_cli.reduction.rank_start import rank_growing_start
from cpfls_cli.reduction.row_space import RowSpace
from cpfls_cli.reduction.run import Run
from cpfls_cli.reduction.selection import StopReason
from cpfls_cli.reduction.settings import CriterionName, ReductionSettings


def sample_limit(space: RowSpace, settings: ReductionSettings) -> int:
    """Return the most samples that may be chosen.

    Raises
    ------
    SettingError
        If the size is larger than the number of samples or too small for the rank.
    """
    size = settings.size
    if size is None:
        return space.samples
    if size > space.samples:
        raise SettingError("size", f"the training set has only {space.samples} samples; keep fewer")
    if size < space.smallest_samples:
        raise _too_few(space, space.smallest_samples)
    return size


def starting_samples(space: RowSpace, criterion: CriterionName, limit: int) -> IntArray:
    """Choose the samples that a criterion begins with: of full rank, but for the printed rule.

    Parameters
    ----------
    space : RowSpace
    criterion : str
    limit : int
        Most samples that may be chosen.

    Raises
    ------
    SettingError
        If the limit is too small for the rank.
    """
    if criterion == "paper-literal":
        return np.zeros(0, dtype=np.int64)
    start = rank_growing_start(space)
    if len(start) > limit:
        raise _too_few(space, len(start))
    return start


def stop_reason(run: Run, settings: ReductionSettings, limit: int) -> StopReason | None:
    """Say what ends a selection, None while nothing does.

    Parameters
    ----------
    run : Run
    settings : ReductionSettings
    limit : int
        Most samples that may be chosen.
    """
    target = settings.condition_number
    if target is not None and run.indices and run.factor.condition_number <= target:
        return "condition-number"
    if len(run.indices) < limit:
        return None
    return "all-samples" if settings.size is None else "size"


def _too_few(space: RowSpace, needed: int) -> SettingError:
    return SettingError("size", f"the training set has rank {space.rank}, which takes {needed} samples or more")
