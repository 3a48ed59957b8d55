"""The stretches of time in which the gap is largest."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_closing, find_objects, label, uniform_filter1d

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.gap.balance.weak_flight import CHANNELS

_AVERAGED_WINDOWS = 5
_OUTSTANDING_SHARE = 0.1
_LONGEST_PAUSE_S = 1.0


class Stretch(NamedTuple):
    """A stretch of a flight with a large gap.

    Attributes
    ----------
    flight : int
        Number of the flight.
    start_s, end_s : float
        On the clock of the flight, s.
    channel : str
        One of `CHANNELS`.
    rms_floors : float
        Root mean square of the residual, in floors.
    """

    flight: int
    start_s: float
    end_s: float
    channel: str
    rms_floors: float


def stretches(
    residual: Array, centres: Array, flight_index: IntArray, level: float = 2.0, most: int = 5
) -> tuple[Stretch, ...]:
    """Find the stretches of time in which the gap is largest.

    Windows whose root mean square over their neighbours is above the level and among the largest tenth of the channel;
    runs with short pauses between them are one stretch.

    Parameters
    ----------
    residual : array, shape (window, 6), floors
    centres : array, shape (window,), s
        Middle of each window.
    flight_index : array of int, shape (window,)
    level : float
        Least root mean square, in floors.
    most : int
        Largest number per channel.

    Returns
    -------
    tuple of Stretch
        Largest first.
    """
    found = []
    for channel in range(residual.shape[1]):
        own = list(_of_channel(channel, residual[:, channel], centres, flight_index, level))
        found += sorted(own, key=_size)[:most]
    return tuple(sorted(found, key=_size))


def _size(stretch: Stretch) -> float:
    return -stretch.rms_floors


def _of_channel(
    channel: int, residual: Array, centres: Array, flight_index: IntArray, level: float
) -> Iterator[Stretch]:
    flights = [np.flatnonzero(flight_index == flight) for flight in np.unique(flight_index)]
    size = [_local_rms(residual[rows]) for rows in flights]
    least = max(level, float(np.quantile(np.concatenate(size), 1 - _OUTSTANDING_SHARE)))
    for rows, local in zip(flights, size, strict=True):
        hop = float(centres[rows[1]] - centres[rows[0]]) if len(rows) > 1 else 0.0
        for run in _runs(local >= least, round(_LONGEST_PAUSE_S / hop) if hop else 0):
            inside = rows[run]
            rms = float(np.sqrt(np.mean(residual[inside] ** 2)))
            start, end = float(centres[inside[0]]) - hop / 2, float(centres[inside[-1]]) + hop / 2
            yield Stretch(int(flight_index[rows[0]]), start, end, CHANNELS[channel], rms)


def _local_rms(residual: Array) -> Array:
    """Average over neighbours: a residual that swings through zero is not small there."""
    # The filter is a running sum, whose rounding can end below 0.
    return np.asarray(np.sqrt(np.maximum(uniform_filter1d(residual**2, _AVERAGED_WINDOWS, mode="nearest"), 0.0)))


def _runs(above: BoolArray, pause: int) -> list[slice]:
    padded = np.pad(above, pause)
    joined = above | binary_closing(padded, np.ones(pause + 1, dtype=bool))[pause : pause + len(above)]
    return [found[0] for found in find_objects(label(joined)[0])]
