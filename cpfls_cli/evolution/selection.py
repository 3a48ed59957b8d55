"""Fitness from ranks, and the choice of parents."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.positions import positions


def linear_ranking_fitness(ranks: IntArray, selective_pressure: float) -> Array:
    """Assign fitness linear in the position among the sorted ranks (RANKING of the Sheffield toolbox).

    ``2 - SP + 2 (SP - 1) (position - 1) / (individuals - 1)``, where position 1 is the least fit.

    Parameters
    ----------
    ranks : array of int, shape (individuals,)
        Smaller is better; two individuals at least.
    selective_pressure : float
        SP, from 1 (all equal) to 2 (the least fit gets nothing).

    Returns
    -------
    array, shape (individuals,)
        With mean 1; individuals of equal rank share the mean of their positions.
    """
    slope = 2.0 * (selective_pressure - 1.0) / (len(ranks) - 1)
    fitness: Array = 2.0 - selective_pressure + slope * (positions(-ranks) - 1.0)
    return fitness


def stochastic_universal_sampling(fitness: Array, count: int, rng: np.random.Generator) -> IntArray:
    """Choose parents with one spin of a wheel with equally spaced pointers (SUS of the Sheffield toolbox).

    Parameters
    ----------
    fitness : array, shape (individuals,)
        Not negative, with a positive sum.
    count : int
        Parents to choose.
    rng : numpy.random.Generator

    Returns
    -------
    array of int, shape (count,)
        Indices in random order. An individual occurs ``count * fitness / sum(fitness)`` times, rounded down
        or up.
    """
    wheel = np.cumsum(fitness)
    pointers = wheel[-1] * (rng.random() + np.arange(count)) / count
    chosen = np.searchsorted(wheel, pointers, side="right")
    # Rounding may put the last pointer on the end of the wheel.
    return rng.permutation(np.minimum(chosen, len(fitness) - 1))
