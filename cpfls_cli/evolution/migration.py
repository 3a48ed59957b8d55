"""Exchange of individuals between subpopulations."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.evolution.subpopulations import members


def migrate(labels: IntArray, rate: float, rng: np.random.Generator) -> IntArray:
    """Exchange individuals over a complete net, chosen uniformly (MIGRATE of the Sheffield toolbox).

    Each subpopulation sends copies of individuals drawn at random to a pool, and replaces as many of its own,
    drawn at random too, by individuals from the pool of all the others. The number is the rounded-down share of
    the smallest subpopulation, at least one, so that subpopulations of unequal size exchange evenly.

    Parameters
    ----------
    labels : array of int, shape (population,)
        Subpopulation of each individual.
    rate : float
        Share of a subpopulation that is replaced; nobody moves at 0, or in a single subpopulation.
    rng : numpy.random.Generator

    Returns
    -------
    array of int, shape (population,)
        For each place in the population, the index of the individual that now takes it.
    """
    source = np.arange(len(labels), dtype=np.int64)
    groups = members(labels)
    if rate == 0.0 or len(groups) == 1:
        return source
    count = _migrants(rate, min(len(group) for group in groups))
    emigrants = [rng.choice(group, count, replace=False) for group in groups]
    for index, group in enumerate(groups):
        pool = np.concatenate(emigrants[:index] + emigrants[index + 1 :])
        source[rng.choice(group, count, replace=False)] = rng.choice(pool, count, replace=False)
    return source


def _migrants(rate: float, size: int) -> int:
    # The small number keeps a product such as 0.29 * 100 from losing its last individual.
    return max(int(rate * size + 1e-9), 1)
