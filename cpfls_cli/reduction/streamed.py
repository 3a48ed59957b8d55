"""Reduce a flight too long to hold: the same choice, from as many samples as fit in memory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cpfls_cli.reduction.greedy import Progress, check_space, choose
from cpfls_cli.reduction.pool import draw_pool
from cpfls_cli.reduction.selection import Selection
from cpfls_cli.reduction.settings import ReductionSettings
from cpfls_cli.reduction.survey import Survey


def reduce_streamed(
    surveyed: Survey, settings: ReductionSettings, rng: np.random.Generator, progress: Progress | None = None
) -> Selection:
    """Choose samples of a surveyed regressor, in one more pass.

    Where all samples fit in the pool, the choice is that of `reduce`. Else it is made from a pool drawn by leverage;
    rank and condition number of the full set are of all samples all the same.

    Parameters
    ----------
    surveyed : Survey
        Made with the settings' rank tolerance.
    settings : ReductionSettings
    rng : numpy.random.Generator
        Not used where all samples fit in the pool.
    progress : callable, optional
        Called with the samples chosen and the most there can be.

    Returns
    -------
    Selection
        With indices into all samples.

    Raises
    ------
    ComputationError
        If the samples of the pool do not determine all that the whole regressor determines.
    SettingError
        See `reduce`.

    References
    ----------
    method.md, section 6.
    """
    pool = draw_pool(surveyed, settings.pool, rng)
    selection = choose(pool.space, settings, progress)
    exhausted = selection.stop_reason == "all-samples" and len(pool.indices) < surveyed.samples
    reason = "pool" if exhausted else selection.stop_reason
    return replace(selection, indices=pool.indices[selection.indices], stop_reason=reason)


def check_streamed(surveyed: Survey, settings: ReductionSettings, rng: np.random.Generator) -> None:
    """Refuse what `reduce_streamed` would refuse, without the work of choosing.

    Raises
    ------
    ComputationError, SettingError
        See `reduce_streamed`.
    """
    check_space(draw_pool(surveyed, settings.pool, rng).space, settings)
