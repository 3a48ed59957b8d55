"""Fuzzy partitions: breakpoints from unconstrained weights, and the genes that encode them."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array


def breakpoints(weights: Array) -> Array:
    """Decode the breakpoints of a partition, ``b_k = sum_{i<=k} a_i / sum_j a_j``.

    Parameters
    ----------
    weights : array, shape (functions - 1,), >= 0
        Weights a_i. An empty array is the partition of one function.

    Returns
    -------
    array, shape (functions,)
        Where each membership function has its only peak: 0, b_1, ..., 1. One function alone has its peak at 0.
        All weights zero give NaN: such a partition is not defined.

    References
    ----------
    Equation (10); method.md section 4.
    """
    total = np.sum(weights)
    if len(weights) == 0:
        return np.zeros(1)
    if not total > 0:
        return np.full(len(weights) + 1, np.nan)
    ends = np.concatenate([[0.0], np.cumsum(weights) / total])
    ends[-1] = 1.0
    return ends


def breakpoint_jacobian(weights: Array) -> Array:
    """Differentiate the inner breakpoints by the weights.

    Parameters
    ----------
    weights : array, shape (functions - 1,), >= 0, not all zero

    Returns
    -------
    array, shape (functions - 2, functions - 1)
        ``d b_k / d a_j = ([j <= k] - b_k) / sum a``; no rows for fewer than three functions.
    """
    count = len(weights)
    inner = breakpoints(weights)[1:-1]
    counted = np.tri(max(count - 1, 0), count)
    return np.asarray((counted - inner[:, None]) / np.sum(weights), dtype=float)


def uniform_weights(functions: int) -> Array:
    """Give the weights of the equidistant partition.

    Parameters
    ----------
    functions : int
        Number of membership functions, at least 1.

    Returns
    -------
    array, shape (functions - 1,)
    """
    return np.ones(functions - 1)
