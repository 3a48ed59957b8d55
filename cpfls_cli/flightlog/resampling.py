"""Values at other times than they were sampled at, absent where their clock paused."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.flightlog.clock import increasing_rows

# Stamps are rounded, so a pause of exactly the allowed length must pass.
_ROUNDING = 1 + 1e-9


def interpolated(time: Array, values: Array, target: Array, longest_s: float) -> Array:
    """Interpolate linearly.

    Parameters
    ----------
    time, values : array, shape (sample,)
        Stamps, s, and values; those that are not finite are absent.
    target : array, shape (row,), s
        When values are wanted.
    longest_s : float
        Longest step between samples that is bridged, s.

    Returns
    -------
    array, shape (row,)
        NaN before the first sample, after the last and in longer steps.
    """
    time, values = _present(time, values)
    if not len(time):
        return np.full(len(target), np.nan)
    return np.where(_bridged(time, target, longest_s), np.interp(target, time, values), np.nan)


def held(time: Array, values: Array, target: Array, longest_s: float) -> Array:
    """Keep the previous value.

    Parameters
    ----------
    time, values, target, longest_s
        See `interpolated`.

    Returns
    -------
    array, shape (row,)
        NaN before the first sample, after the last and in longer steps.
    """
    time, values = _present(time, values)
    if not len(time):
        return np.full(len(target), np.nan)
    previous = np.maximum(np.searchsorted(time, target, side="right") - 1, 0)
    return np.where(_bridged(time, target, longest_s), values[previous], np.nan)


def _present(time: Array, values: Array) -> tuple[Array, Array]:
    finite = np.isfinite(values)
    rows, _ = increasing_rows(time[finite])
    return time[finite][rows], values[finite][rows]


def _bridged(time: Array, target: Array, longest_s: float) -> BoolArray:
    """Mark the targets at a sample, or between two that are near enough."""
    after = np.searchsorted(time, target, side="left")
    nearest = np.minimum(after, len(time) - 1)
    between = (after > 0) & (after < len(time))
    near = np.diff(time, prepend=time[0])[nearest] <= longest_s * _ROUNDING
    return np.asarray((time[nearest] == target) | (between & near), dtype=bool)
