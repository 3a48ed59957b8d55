"""Ranks of individuals with several objectives; smaller is better."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.dominance import dominance_matrix, worst_where_not_finite
from cpfls_cli.evolution.positions import positions
from cpfls_cli.evolution.settings import Ranking


def rank(objectives: Array, method: Ranking, first_weight: int = 1) -> IntArray:
    """Rank individuals by the method of this name.

    Parameters
    ----------
    objectives : array, shape (individuals, objectives)
        To be minimised. An objective that is not finite counts as worse than every finite one.
    method : {"quantity-dominance", "pareto-count", "pareto-fronts"}
    first_weight : int, optional
        How often the first objective counts in quantity-dominance; the Pareto rankings know no weights.

    Returns
    -------
    array of int, shape (individuals,)
        Smaller is better. Under each method a dominating individual ranks before the dominated one.

    References
    ----------
    Paper, section 6; method.md section 7.
    """
    if method == "quantity-dominance":
        return quantity_dominance_ranks(objectives, first_weight)
    return pareto_count_ranks(objectives) if method == "pareto-count" else pareto_front_ranks(objectives)


def quantity_dominance_ranks(objectives: Array, first_weight: int = 1) -> IntArray:
    """Sum, over the population, the components in which others are better minus those in which they are worse.

    ``rank_i = sum_j sum_k w_k sign(f_ik - f_jk)``, a Borda count: in each objective the individual's position
    among the sorted population tells both numbers, so the cost is n log n. In the paper all weights are 1.

    Parameters
    ----------
    objectives : array, shape (individuals, objectives)
    first_weight : int, optional
        Weight of the first objective, positive; that of the others is 1.

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
    signs = np.column_stack([2.0 * positions(cost) - (len(costs) + 1) for cost in costs.T]).astype(np.int64)
    signs[:, 0] *= first_weight
    ranks: IntArray = signs.sum(axis=1)
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
