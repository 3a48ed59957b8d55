"""A regressor in memory reduced in one call, for tests and benchmarks; the program reads it in chunks."""

import numpy as np

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
