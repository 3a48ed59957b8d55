"""Views of a residual: its worst stretches of time, and its mean over two signals."""

from collections.abc import Iterator, Mapping
from typing import Annotated, NamedTuple

import numpy as np
from scipy.ndimage import binary_closing, uniform_filter1d

from cpfls_cli.arrays import Array, IntArray, runs
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.residual.dependence import OUTER_PERCENT
from cpfls_cli.result import About, about, result
from cpfls_cli.rounding import ascending

_WORST_SHARE = 0.1  # Of the time is called worst.
_LONGEST_PAUSE_S = 1.0
"""With pauses up to this long in it, over which the residual is averaged: a zero crossing makes no gap small."""


class GapStretch(NamedTuple):
    """A stretch of a flight with a large gap."""

    flight: Annotated[int, About("index of the flight")]
    start_s: Annotated[float, About("on the clock of the flight", unit="s")]
    end_s: Annotated[float, About("on the clock of the flight", unit="s")]
    channel: Annotated[str, About("channel of the gap")]
    rms_floors: Annotated[float, About("root mean square of the gap there, in floors")]


def stretches(
    residual: Array, centres: Array, flight_index: IntArray, level: float = 2.0, most: int = 5
) -> tuple[GapStretch, ...]:
    """Find the stretches of time in which the gap is largest.

    Windows whose root mean square over their neighbours is above the level and among the largest tenth of the channel;
    runs with short pauses between them are one stretch.

    `residual`: shape (window, 6), floors.
    `centres`, shape (window,), s: middle of each window.
    `flight_index`: shape (window,).
    `level`: least root mean square, in floors.
    `most`: largest number per channel.
    Result: largest first.
    """
    largest = []
    for channel in range(residual.shape[1]):
        of_channel = list(_of_channel(channel, residual[:, channel], centres, flight_index, level))
        largest += ascending(of_channel, lambda stretch: -stretch.rms_floors)[:most]
    return tuple(ascending(largest, lambda stretch: -stretch.rms_floors))


def _of_channel(
    channel: int, residual: Array, centres: Array, flight_index: IntArray, level: float
) -> Iterator[GapStretch]:
    flights = [np.flatnonzero(flight_index == flight) for flight in np.unique(flight_index)]
    hops = [float(np.ptp(centres[rows[:2]])) for rows in flights]
    pauses = [round(_LONGEST_PAUSE_S / hop) if hop else 0 for hop in hops]
    # What is averaged over neighbours has no zero crossings; the filter's running sum can end below 0 by rounding.
    size = [
        np.sqrt(np.maximum(uniform_filter1d(residual[rows] ** 2, max(1, pause), mode="nearest"), 0.0))
        for rows, pause in zip(flights, pauses, strict=True)
    ]
    least = max(level, float(np.quantile(np.concatenate(size), 1 - _WORST_SHARE)))
    for rows, local, hop, pause in zip(flights, size, hops, pauses, strict=True):
        above = local >= least
        joined = binary_closing(np.pad(above, pause), np.ones(pause + 1, dtype=bool))[pause : pause + len(above)]
        for run in runs(above | joined):
            inside = rows[slice(*run)]
            rms = float(np.sqrt(np.mean(residual[inside] ** 2)))
            start, end = float(centres[inside[0]]) - hop / 2, float(centres[inside[-1]]) + hop / 2
            yield GapStretch(int(flight_index[rows[0]]), start, end, CHANNELS[channel], rms)


@result
class HeatMap:
    """Mean gap of a channel in the cells of a grid over two signals."""

    channel: str = about("channel with the largest gap in floors")
    signals: tuple[str, ...] = about("the two signals that explain it best", "2")
    first_edge: Array = about("edges of the cells along the first signal", "edge", unit="SI", brief=False)
    second_edge: Array = about("edges of the cells along the second signal", "edge", unit="SI", brief=False)
    mean: Array = about(
        "mean gap in each cell, N m or N; NaN in empty ones", "first", "second", unit="SI", gaps=True, brief=False
    )
    count: Array = about("windows in each cell", "first", "second", brief=False)


def heat_map(
    channel: str, residual: Array, signals: tuple[str, str], states: Mapping[str, Array], bins: int = 12
) -> HeatMap:
    """Average a residual over the cells of two signals.

    The outer cells also take the half per cent of windows beyond each end of the grid, so that a few windows do not
    stretch it.

    `residual`, shape (window,): of the channel.
    `states`, each shape (window,): by signal; windows where one is not a number are left out.
    `bins`: cells along each signal.
    """
    first, second = (states[name] for name in signals)
    known = np.isfinite(residual) & np.isfinite(first) & np.isfinite(second)
    values = [first[known], second[known]]
    edges = [_edges(each, bins) for each in values]
    across, along = (np.clip(each, own[0], own[-1]) for own, each in zip(edges, values, strict=True))
    count = np.histogram2d(across, along, edges)[0]
    total = np.histogram2d(across, along, edges, weights=residual[known])[0]
    mean = np.divide(total, count, out=np.full_like(count, np.nan), where=count > 0)
    return HeatMap(channel=channel, signals=signals, first_edge=edges[0], second_edge=edges[1], mean=mean, count=count)


def _edges(signal: Array, bins: int) -> Array:
    if not len(signal):
        return np.linspace(0.0, 1.0, bins + 1)
    low, high = np.percentile(signal, [OUTER_PERCENT, 100 - OUTER_PERCENT])
    # A signal that stands still still needs cells of some width.
    return np.linspace(low, high if high > low else low + max(1e-9, 1e-9 * abs(low)), bins + 1)
