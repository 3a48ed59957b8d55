"""Positions among sorted values, ties averaged."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, IntArray


def positions(values: Array | IntArray) -> Array:
    """Give each value its position among the sorted values, equal ones the mean of theirs.

    Parameters
    ----------
    values : array, shape (n,)
        No NaN; infinite values of one sign are equal.

    Returns
    -------
    array, shape (n,)
        From 1 to n, with halves.
    """
    # scipy.stats.rankdata does the same, but its import takes longer than the rest of the start.
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(count) - 0.5 * (count - 1))[place])
