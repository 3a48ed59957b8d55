"""Bad values of a channel: absent, spikes, stuck at an extreme."""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cpfls_cli.arrays import Array, BoolArray

_DEVIATION_OF_MEDIAN = 1.4826


def find_spikes(values: Array, deviations: float, window: int) -> BoolArray:
    """Find spikes by Hampel's identifier, ``|x - median| > deviations * scale``.

    The scale is the largest of 1.4826 times the median departure from the median within the running window, 1.4826
    times the median departure of the whole channel from its running median, and the channel's mean step. The first is
    large where the signal turns fast, so that a resolved crest is none; the last two keep a quiet stretch, and a
    signal of few distinct values, from being taken for spikes.

    Parameters
    ----------
    values : array, shape (sample,)
        One channel; values that are not finite are no spikes.
    deviations : float
        Threshold in robust standard deviations.
    window : int
        Samples of the running median.

    Returns
    -------
    array of bool, shape (sample,)
        True at a spike.

    References
    ----------
    F. R. Hampel, The influence curve and its role in robust estimation, 1974.
    """
    spikes = np.zeros(len(values), dtype=bool)
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 2:
        return spikes
    around = _windows(values[known], window)
    median = np.median(around, axis=1)
    departure = np.abs(values[known] - median)
    local = np.median(np.abs(around - median[:, None]), axis=1)
    scale = _DEVIATION_OF_MEDIAN * np.maximum(local, np.median(departure))
    spikes[known] = departure > deviations * np.maximum(scale, np.abs(np.diff(values[known])).mean())
    return spikes


def count_saturated(values: Array, samples: int, rest: float | None = None) -> int:
    """Count the values in runs at the channel's smallest or largest value.

    Parameters
    ----------
    values : array, shape (sample,)
        One channel.
    samples : int
        Length from which a run counts.
    rest : float, optional
        Extreme at which the channel may stand without being saturated.

    Returns
    -------
    int
        Values in such runs; 0 for a channel that is constant throughout.
    """
    known = values[np.isfinite(values)]
    if len(known) == 0 or known.min() == known.max():
        return 0
    extremes = [extreme for extreme in (known.min(), known.max()) if extreme != rest]
    return sum(_values_in_runs(known == extreme, samples) for extreme in extremes)


def fill(time: Array, values: Array, target: Array) -> Array:
    """Interpolate the values that are present linearly at other times.

    Parameters
    ----------
    time : array, shape (sample,), s
    values : array, shape (sample, column)
        Values that are not finite are absent.
    target : array, shape (time,), s

    Returns
    -------
    array, shape (time, column)
    """
    known = np.isfinite(values)
    return np.column_stack([np.interp(target, time[k], v[k]) for k, v in zip(known.T, values.T, strict=True)])


def without_jumps(angles: Array, turn: float = 2 * pi) -> Array:
    """Remove the jumps of full turns from angles, over absent values.

    Parameters
    ----------
    angles : array, shape (sample,)
    turn : float
        A full turn in the unit of the angles; rad if not given.

    Returns
    -------
    array, shape (sample,)
    """
    known = np.isfinite(angles)
    continuous = np.array(angles, dtype=float)
    continuous[known] = np.unwrap(continuous[known], period=turn)
    return continuous


def same_sign(quaternion: Array) -> Array:
    """Give each quaternion the sign that is nearer to the one before; q and -q are one attitude.

    Parameters
    ----------
    quaternion : array, shape (sample, 4)

    Returns
    -------
    array, shape (sample, 4)
    """
    known = np.isfinite(quaternion).all(axis=1)
    continuous = np.array(quaternion, dtype=float)
    present = continuous[known]
    flips = np.sign((present[1:] * present[:-1]).sum(axis=1))
    continuous[known] = present * np.cumprod(np.concatenate([[1.0], np.where(flips < 0, -1.0, 1.0)]))[:, None]
    return continuous


def _windows(values: Array, window: int) -> Array:
    """Surround each value by its neighbours; mirrored at the ends, where repeating would hide a spike."""
    before = window // 2
    padded = np.pad(values, (before, window - 1 - before), mode="reflect")
    return np.asarray(sliding_window_view(padded, window), dtype=float)


def _values_in_runs(marked: BoolArray, samples: int) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(int)))
    lengths = np.diff(edges.reshape(-1, 2), axis=1)
    return int(lengths[lengths >= samples].sum())
