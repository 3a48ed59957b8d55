"""Pareto dominance between vectors of objectives that are minimised."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray


def worst_where_not_finite(objectives: Array) -> Array:
    """Replace every objective that is not finite by +inf, the worst there is.

    Parameters
    ----------
    objectives : array, shape (individuals, objectives)

    Returns
    -------
    array, shape (individuals, objectives)
        Without NaN, so every comparison is defined.
    """
    return np.where(np.isfinite(objectives), objectives, np.inf)


def dominance_matrix(objectives: Array) -> BoolArray:
    """Tell which individual Pareto-dominates which: nowhere worse, and better in one objective at least.

    Parameters
    ----------
    objectives : array, shape (individuals, objectives)

    Returns
    -------
    array of bool, shape (individuals, individuals)
        Element (i, j) is true where i dominates j.

    References
    ----------
    Paper, section 6.
    """
    costs = worst_where_not_finite(objectives)
    nowhere_worse = np.ones((len(costs), len(costs)), dtype=np.bool_)
    for cost in costs.T:
        nowhere_worse &= cost[:, np.newaxis] <= cost
    return nowhere_worse & ~nowhere_worse.T


def pareto_front(objectives: Array) -> IntArray:
    """Find the non-dominated individuals.

    Parameters
    ----------
    objectives : array, shape (individuals, objectives)

    Returns
    -------
    array of int, shape (front,)
        Indices in increasing order. Of equal vectors of objectives only the first is kept.
    """
    costs = worst_where_not_finite(objectives)
    front = []
    # In lexicographic order nobody is dominated by a later one, so the first of the remaining is always kept.
    remaining = np.lexsort(costs.T[::-1])
    while remaining.size:
        front.append(remaining[0])
        remaining = remaining[np.any(costs[remaining] < costs[remaining[0]], axis=1)]
    return np.sort(np.array(front, dtype=np.int64))
