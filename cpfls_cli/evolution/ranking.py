"""Ranks of individuals with several objectives; smaller is better."""

from __future__ import annotations

import numpy as np
from scipy.stats import rankdata

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.dominance import dominance_matrix, worst_where_not_finite
from cpfls_cli.evolution.settings import Ranking


def rank(objectives: Array, method: Ranking) -> IntArray:
    """Rank individuals by the method of this name.

    Parameters
    ----------
    objectives : array, shape (individuals, objectives)
        To be minimised. An objective that is not finite counts as worse than every finite one.
    method : {"quantity-dominance", "pareto-count", "pareto-fronts"}

    Returns
    -------
    array of int, shape (individuals,)
        Smaller is better. Under each method a dominating individual ranks before the dominated one.

    References
    ----------
    Paper, section 6; method.md section 7.
    """
    methods = {
        "quantity-dominance": quantity_dominance_ranks,
        "pareto-count": pareto_count_ranks,
        "pareto-fronts": pareto_front_ranks,
    }
    return methods[method](objectives)


def quantity_dominance_ranks(objectives: Array) -> IntArray:
    """Sum, over the population, the components in which others are better minus those in which they are worse.

    ``rank_i = sum_j sum_k sign(f_ik - f_jk)``, a Borda count: in each objective the individual's position
    among the sorted population tells both numbers, so the cost is n log n.

    Parameters
    ----------
    objectives : array, shape (individuals, objectives)

    Returns
    -------
    array of int, shape (individuals,)
        Sums to zero over the population; ties count zero.

    References
    ----------
    Paper, section 6, after its reference [6].
    """
    costs = worst_where_not_finite(objectives)
    # With ties averaged, position p of n has (smaller - larger) = 2 p - (n + 1), a whole number.
    signs = 2.0 * rankdata(costs, method="average", axis=0) - (len(costs) + 1)
    ranks: IntArray = signs.sum(axis=1).astype(np.int64)
    return ranks


def pareto_count_ranks(objectives: Array) -> IntArray:
    """Count the individuals that dominate, plus one ("block-type" ranking).

    Parameters
    ----------
    objectives : array, shape (individuals, objectives)

    Returns
    -------
    array of int, shape (individuals,)
        One for the non-dominated.

    References
    ----------
    Paper, section 6, after its reference [5].
    """
    dominating: IntArray = np.count_nonzero(dominance_matrix(objectives), axis=0)
    return 1 + dominating


def pareto_front_ranks(objectives: Array) -> IntArray:
    """Sort into non-dominated fronts and give each its number ("slice-type" ranking).

    Parameters
    ----------
    objectives : array, shape (individuals, objectives)

    Returns
    -------
    array of int, shape (individuals,)
        One for the non-dominated, two for those non-dominated once these are removed, and so on.

    References
    ----------
    Paper, section 6, after its reference [4].
    """
    dominates = dominance_matrix(objectives)
    dominating = np.count_nonzero(dominates, axis=0)
    ranks = np.zeros(len(dominates), dtype=np.int64)
    front = 0
    while not np.all(ranks):
        front += 1
        members = (dominating == 0) & (ranks == 0)
        ranks[members] = front
        dominating = dominating - np.count_nonzero(dominates[members], axis=0)
    return ranks
