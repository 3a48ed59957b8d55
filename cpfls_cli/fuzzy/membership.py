"""Zadeh-formed membership functions on a partition: breakpoints, degrees, slopes, derivatives by the breakpoints.

The formula is that of `z_function`: the falling edge of a function over the position u between its own peak (0) and
the next one (1). All else of a partition follows from it, whatever its shape: the next function rises as 1 minus it,
and the slopes follow by the chain rule. It has to fall from 1 to 0, with slope 0 at both ends: else the torque jumps.

Another formula is written here, and in the copies that stand where this one cannot be called:

- `cpfls_cli.regressor.kernels`, `_z_function`: the compiled loops of the search. numba caches compiled code by its
  file, and would not notice that a function which it compiled in from another file has changed.
- `cpfls_cli.playback.remainder`, `_blended`: the vehicle in any kind of numbers, which simulation and exports trace.
- `cpfls_cli/export/templates/model.c.j2`, `rules_of`, and `model.py.j2`, `_firing`, this in NumPy, CasADi and JAX: over
  the attitude. They run without this package; `tests/unit/export/test_simulators.py` flies them.
- `Z_FUNCTION` here, the words that the JSON of a model carries, and docs/method.md section 4.

`tests/unit/export/test_membership.py` evaluates all of them at the same points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray

Z_FUNCTION = "1 - 2 u^2 up to u = 1/2 and 2 (1 - u)^2 after it"
"""`z_function` in words."""


def breakpoints(weights: Array) -> Array:
    """Decode the breakpoints of a partition, ``b_k = sum_{i<=k} a_i / sum_j a_j``.

    Parameters
    ----------
    weights : array, shape (..., functions - 1), >= 0
        Weights a_i. An empty last axis is the partition of one function.

    Returns
    -------
    array, shape (..., functions)
        Where each membership function has its only peak: 0, b_1, ..., 1. One function alone has its peak at 0.
        All weights zero give NaN: such a partition is not defined.

    References
    ----------
    Equation (10); method.md section 4.
    """
    ends = np.zeros((*weights.shape[:-1], weights.shape[-1] + 1))
    if weights.shape[-1] == 0:
        return ends
    total = np.sum(weights, axis=-1, keepdims=True)
    undefined = ~(total > 0)
    np.cumsum(weights, axis=-1, out=ends[..., 1:])
    ends[..., 1:] /= np.where(undefined, 1.0, total)
    ends[..., -1] = 1.0
    ends[undefined[..., 0]] = np.nan
    return ends


def uniform_weights(functions: int) -> Array:
    """Give the weights of the equidistant partition of one or more functions, shape (functions - 1,)."""
    return np.ones(functions - 1)


@dataclass(frozen=True)
class Memberships:
    """Degrees of membership of samples in the functions of one partition, or firing of the rules along one input.

    Attributes
    ----------
    value : array, shape (samples, functions)
        Every row sums to 1.
    slope : array, shape (samples, functions)
        Derivative by the scaled input, or by the angle.
    """

    value: Array
    slope: Array


def z_function(position: Array) -> tuple[Array, Array, Array]:
    """Evaluate Zadeh's z-function, the edge along which a membership function falls, and two derivatives by u.

    ``z(u) = 1 - 2 u^2`` up to the middle, ``2 (1 - u)^2`` after it; u is 0 at the function's own peak, 1 at its
    neighbour's. Equation (8) with the squares that its print lost; method.md section 4.
    """
    left = position < 0.5
    rest = 1.0 - position
    value = np.where(left, 1.0 - 2.0 * position**2, 2.0 * rest**2)
    first = np.where(left, -4.0 * position, -4.0 * rest)
    return value, first, np.where(left, -4.0, 4.0)


def memberships(scaled_input: Array, breakpoints: Array) -> Memberships:
    """Evaluate all functions of a partition.

    Between two neighbouring breakpoints the left function falls along `z_function`, and the right one rises along
    s = 1 - z. Beyond the ends the outer functions stay at 1.

    Parameters
    ----------
    scaled_input : array, shape (samples,)
        Input on [0, 1]; values outside belong to the outer functions.
    breakpoints : array, shape (functions,)
        Ascending peaks from 0 to 1; equal neighbours make a function of zero width.

    References
    ----------
    Equation (8) with the squares that its print lost; method.md section 4.
    """
    if len(breakpoints) == 1:
        return Memberships(np.ones((len(scaled_input), 1)), np.zeros((len(scaled_input), 1)))
    clipped = np.minimum(np.maximum(scaled_input, 0.0), 1.0)
    found = np.searchsorted(breakpoints, clipped, side="right") - 1
    interval = np.minimum(np.maximum(found, 0), len(breakpoints) - 2)
    width = np.diff(breakpoints)[interval]
    # A function of zero width is met only at the very end of the range; its left neighbour has gone there.
    empty = width <= 0.0
    safe = np.where(empty, 1.0, width)
    falling, slope, _ = z_function(np.where(empty, 1.0, (clipped - breakpoints[interval]) / safe))
    slope = np.where(clipped == scaled_input, slope, 0.0) / safe
    functions = len(breakpoints)
    return Memberships(
        _spread(falling, 1.0 - falling, interval, functions), _spread(slope, -slope, interval, functions)
    )


def join_ends(values: Array) -> Array:
    """Join the first and the last function of a partition into one, which closes the circle.

    Parameters
    ----------
    values : array, shape (samples, functions, ...)
        Anything that adds up over functions: degrees of membership, slopes, sensitivities.

    Returns
    -------
    array, shape (samples, max(functions - 1, 1), ...)

    References
    ----------
    Tables 1 and 2: ``mu_pi0 = mu_z + mu_s``.
    """
    if values.shape[1] == 1:
        return values
    joined = values[:, :-1].copy()
    joined[:, 0] += values[:, -1]
    return joined


def _spread(left: Array, right: Array, interval: IntArray, functions: int) -> Array:
    spread = np.zeros((len(left), functions))
    rows = np.arange(len(left))
    spread[rows, interval] = left
    spread[rows, interval + 1] += right
    return spread
