"""Dominance between vectors of objectives that are minimised, and ranks of individuals; smaller is better."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.evolution.settings import Ranking
from cpfls_cli.rounding import levelled


def comparable(objectives: Array) -> Array:
    """Give objectives that compare alike on every machine: the worst where not finite, and one value to those tied.

    Parameters
    ----------
    objectives : array, shape (individuals, objectives)
    """
    return np.stack([levelled(cost) for cost in worst_where_not_finite(objectives).T], axis=1)


def worst_where_not_finite(objectives: Array) -> Array:
    """Replace every objective that is not finite, NaN too, by +inf, so that every comparison is defined."""
    return np.where(np.isfinite(objectives), objectives, np.inf)


def pareto_front(objectives: Array) -> IntArray:
    """Find the non-dominated individuals, in increasing order; of equal objectives only the first is kept."""
    costs = comparable(objectives)
    front = []
    # In lexicographic order nobody is dominated by a later one, so the first of the remaining is always kept.
    remaining = np.lexsort(costs.T[::-1])
    while remaining.size:
        front.append(remaining[0])
        remaining = remaining[np.any(costs[remaining] < costs[remaining[0]], axis=1)]
    return np.sort(np.array(front, dtype=np.int64))


def rank(objectives: Array, method: Ranking, first_weight: int = 1) -> IntArray:
    """Rank individuals by the method of this name; smaller is better.

    Quantity dominance sums, over the population, the components in which others are better minus those in which they
    are worse, ``rank_i = sum_j sum_k w_k sign(f_ik - f_jk)``: a Borda count, which sums to zero over the population,
    with ties counted zero. The first objective may weigh more there (`first_weight`), where all are 1 in the paper. The
    Pareto count ("block-type") is one more than the number of individuals that dominate. Pareto fronts ("slice-type")
    are sorted out one after the other, and each gives its number. Objectives are to be minimised; one that is not
    finite counts as worse than every finite one. Under each method a dominating individual ranks before the dominated
    one. Paper, section 6, after its references [6], [5] and [4]; method.md section 7.
    """
    costs = comparable(objectives)
    if method == "quantity-dominance":
        return _quantity_dominance(costs, first_weight)
    dominates = _dominance(costs)
    if method == "pareto-count":
        return 1 + np.asarray(np.count_nonzero(dominates, axis=0))
    return _front_numbers(dominates)


def _quantity_dominance(costs: Array, first_weight: int) -> IntArray:
    """Sum the signs of the differences: the positions among the sorted population tell them, so it costs n log n."""
    # With ties averaged, position p of n has (smaller - larger) = 2 p - (n + 1), a whole number.
    signs = np.column_stack([2.0 * positions(cost) - (len(costs) + 1) for cost in costs.T]).astype(np.int64)
    signs[:, 0] *= first_weight
    ranks: IntArray = signs.sum(axis=1)
    return ranks


def _dominance(costs: Array) -> BoolArray:
    """Tell which individual (row) dominates which: nowhere worse, and better in one objective at least."""
    nowhere_worse = np.ones((len(costs), len(costs)), dtype=np.bool_)
    for cost in costs.T:
        nowhere_worse &= cost[:, np.newaxis] <= cost
    return nowhere_worse & ~nowhere_worse.T


def _front_numbers(dominates: BoolArray) -> IntArray:
    """Give the fronts their numbers: one for the non-dominated, two for those that are it without these, and so on."""
    dominating = np.count_nonzero(dominates, axis=0)
    ranks = np.zeros(len(dominates), dtype=np.int64)
    front = 0
    while not np.all(ranks):
        front += 1
        members = (dominating == 0) & (ranks == 0)
        ranks[members] = front
        dominating = dominating - np.count_nonzero(dominates[members], axis=0)
    return ranks


def positions(values: Array | IntArray) -> Array:
    """Give each value its position from 1 on among the sorted values, equal ones the mean of theirs.

    Without NaN; infinite values of one sign are equal.
    """
    # scipy.stats.rankdata does the same, but its import takes longer than the rest of the start.
    _, inverse, count = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(count) - 0.5 * (count - 1))[inverse])
