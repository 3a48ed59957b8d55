"""A regressor in memory reduced in one call, for tests and benchmarks; the program reads it in chunks."""

from dataclasses import replace

import numpy as np

from cpfls_cli.reduction.criteria import EXCHANGE_INFORMATION
from cpfls_cli.reduction.survey import space_of, survey
from cpfls_cli.reduction.training_set import choose, random_streamed


def row_space(Q, rank_tolerance):
    """Project a regressor, shape (samples, 3, parameters), on its numerical row space."""
    surveyed = survey(lambda: [Q], rank_tolerance)
    return space_of(surveyed, np.concatenate(list(surveyed.projected())))


def reduce(Q, settings, progress=None):
    """Choose samples of a regressor."""
    return choose(row_space(Q, settings.rank_tolerance), settings, progress)


def random_selections(Q, size, count, rng, rank_tolerance=1e-10):
    """Choose samples of a regressor at random, several times over."""
    return random_streamed(survey(lambda: [Q], rank_tolerance), size, count, rng)


def beginning(selection, size):
    """Give what a smaller size would have chosen, or None where a selection did not begin with it.

    Samples that are chosen one by one do not depend on what comes after them. Exchanges and every n-th sample know the
    size from the start, and some criteria refuse a size below the full rank.
    """
    if size == selection.selected:
        return selection
    one_by_one = selection.criterion not in {*EXCHANGE_INFORMATION, "even"}
    if not one_by_one or size > selection.selected or selection.rank_trace[size - 1] < selection.rank_full:
        return None
    names = ("condition_number_trace", "singular_value_min_trace", "singular_value_max_trace", "rank_trace")
    return replace(
        selection,
        indices=selection.indices[:size],
        condition_number=float(selection.condition_number_trace[size - 1]),
        rank=selection.rank_full,
        stop_reason="size" if size < selection.selected else selection.stop_reason,
        **{name: getattr(selection, name)[:size] for name in names},
    )
