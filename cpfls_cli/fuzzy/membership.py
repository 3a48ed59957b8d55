"""Zadeh-formed membership functions of a partition, their slopes, and their derivatives by the breakpoints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray


@dataclass(frozen=True)
class Memberships:
    """Degrees of membership of samples in the functions of one partition.

    Attributes
    ----------
    value : array, shape (samples, functions)
        Degrees of membership; every row sums to 1.
    slope : array, shape (samples, functions)
        Derivative by the scaled input.
    """

    value: Array
    slope: Array


@dataclass(frozen=True)
class MembershipSensitivity:
    """Derivatives of memberships and of their slopes by the inner breakpoints.

    Attributes
    ----------
    value : array, shape (samples, functions, functions - 2)
    slope : array, shape (samples, functions, functions - 2)
    """

    value: Array
    slope: Array


@dataclass(frozen=True)
class _Located:
    """Where samples lie: interval, its width, and the position u in it (0 at its left end, 1 at its right end)."""

    interval: IntArray
    width: Array
    position: Array


def memberships(scaled_input: Array, breakpoints: Array) -> Memberships:
    """Evaluate all functions of a partition.

    Between two neighbouring breakpoints the left function falls along Zadeh's z-function, ``1 - 2 u^2`` up to the
    middle and ``2 (1 - u)^2`` after it, and the right one rises along s = 1 - z. Beyond the ends the outer functions
    stay at 1.

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
    at = _locate(scaled_input, breakpoints)
    falling, slope, _ = _z_function(at.position)
    slope = np.where(_inside(scaled_input), slope, 0.0) / at.width
    return Memberships(
        _spread(falling, 1.0 - falling, at.interval, len(breakpoints)),
        _spread(slope, -slope, at.interval, len(breakpoints)),
    )


def membership_sensitivity(scaled_input: Array, breakpoints: Array) -> MembershipSensitivity:
    """Differentiate memberships and their slopes by the inner breakpoints, in closed form.

    With ``u = (x - b1) / w``, ``w = b2 - b1``: ``du/db1 = (u - 1) / w`` and ``du/db2 = -u / w``.

    Parameters
    ----------
    scaled_input : array, shape (samples,)
    breakpoints : array, shape (functions,)
    """
    samples, functions = len(scaled_input), len(breakpoints)
    value = np.zeros((samples, functions, functions))
    slope = np.zeros((samples, functions, functions))
    if functions > 2:
        at = _locate(scaled_input, breakpoints)
        _, first, second = (np.where(_inside(scaled_input), part, 0.0) for part in _z_function(at.position))
        rows = np.arange(samples)
        for end, towards in ((0, at.position - 1.0), (1, -at.position)):
            by_value = first * towards / at.width
            by_slope = (second * towards + (1 - 2 * end) * first) / at.width**2
            for side, sign in ((0, 1.0), (1, -1.0)):
                value[rows, at.interval + side, at.interval + end] = sign * by_value
                slope[rows, at.interval + side, at.interval + end] = sign * by_slope
    return MembershipSensitivity(value[:, :, 1:-1], slope[:, :, 1:-1])


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


def _inside(scaled_input: Array) -> Array:
    return np.asarray((scaled_input >= 0.0) & (scaled_input <= 1.0))


def _locate(scaled_input: Array, breakpoints: Array) -> _Located:
    clipped = np.clip(scaled_input, 0.0, 1.0)
    interval = np.clip(np.searchsorted(breakpoints, clipped, side="right") - 1, 0, len(breakpoints) - 2)
    width = np.diff(breakpoints)[interval]
    # A function of zero width is met only at the very end of the range; its left neighbour has gone there.
    empty = width <= 0.0
    safe = np.where(empty, 1.0, width)
    position = np.where(empty, 1.0, (clipped - breakpoints[interval]) / safe)
    return _Located(interval, safe, position)


def _z_function(position: Array) -> tuple[Array, Array, Array]:
    """Zadeh's z-function of u on [0, 1] with its first and second derivative."""
    left = position < 0.5
    rest = 1.0 - position
    value = np.where(left, 1.0 - 2.0 * position**2, 2.0 * rest**2)
    first = np.where(left, -4.0 * position, -4.0 * rest)
    return value, first, np.where(left, -4.0, 4.0)


def _spread(left: Array, right: Array, interval: IntArray, functions: int) -> Array:
    spread = np.zeros((len(left), functions))
    rows = np.arange(len(left))
    spread[rows, interval] = left
    spread[rows, interval + 1] += right
    return spread
