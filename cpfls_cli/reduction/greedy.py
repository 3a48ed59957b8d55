"""Reduce a training set to the samples worth learning from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.reduction.criteria import EXCHANGE_INFORMATION, make_criterion
from cpfls_cli.reduction.exchange import exchange_samples
from cpfls_cli.reduction.limits import sample_limit, starting_samples, stop_reason
from cpfls_cli.reduction.row_space import RowSpace, row_space
from cpfls_cli.reduction.run import Run
from cpfls_cli.reduction.selection import Selection
from cpfls_cli.reduction.settings import ReductionSettings

Progress = Callable[[int, int], None]


def reduce(Q: Array, settings: ReductionSettings, progress: Progress | None = None) -> Selection:
    """Choose samples one by one, each the best next one by the criterion, or all of them by exchanges.

    All criteria but the printed rule begin with the fewest samples that reach the full rank. Where all samples
    together are rank deficient, the selection works in their row space. Samples chosen by exchanges are returned, and
    traced, in the order in which the criterion D takes them.

    Parameters
    ----------
    Q : array, shape (samples, 3, parameters)
        Regressor, three rows per sample.
    settings : ReductionSettings
    progress : callable, optional
        Called with the samples chosen and the most there can be.

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

    Raises
    ------
    SettingError
        See `reduce`.
    """
    limit = sample_limit(space, settings)
    start = starting_samples(space, settings.criterion, limit)
    if settings.criterion in EXCHANGE_INFORMATION:
        return _exchanged(space, start, limit, settings, progress)
    criterion = make_criterion(space, settings.criterion)
    return _one_by_one(Run(space, criterion, start), limit, settings, progress)


def check_space(space: RowSpace, settings: ReductionSettings) -> None:
    """Refuse what `choose` would refuse, without the work of choosing.

    Raises
    ------
    SettingError
        See `reduce`.
    """
    starting_samples(space, settings.criterion, sample_limit(space, settings))


def _exchanged(
    space: RowSpace, start: IntArray, limit: int, settings: ReductionSettings, progress: Progress | None
) -> Selection:
    """Exchange samples, then put those chosen in the D-optimal order, and stop there as for every criterion."""
    information = EXCHANGE_INFORMATION[settings.criterion]
    exchanged = exchange_samples(space, start, limit, information, settings.condition_number)
    chosen = replace(space, rows=space.rows[exchanged.indices])
    run = Run(chosen, make_criterion(chosen, "D"), starting_samples(chosen, "D", chosen.samples))
    selection = _one_by_one(run, chosen.samples, settings, progress)
    indices = exchanged.indices[selection.indices]
    return replace(selection, indices=indices, exchanges=exchanged.exchanges)


def _one_by_one(run: Run, limit: int, settings: ReductionSettings, progress: Progress | None) -> Selection:
    while not (reason := stop_reason(run, settings, limit)):
        run.step()
        if progress is not None:
            progress(len(run.indices), limit)
    return run.selection(settings.criterion, reason)
