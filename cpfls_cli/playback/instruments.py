"""What moves a vehicle and knows nothing of its gusts: the same path flown again, or what was asked from outside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.playback.flight import PlaybackFlight

_ALIKE = 0.5
"""Correlation from which on two flights fly the same path. Paths that have nothing to do with each other stay below
0.3 at every shift, runs of one path lie above 0.6."""
_COMMON_S = 8.0
"""That two flights have in common at least: shorter, unlike paths may look alike."""
_COARSE_HZ = 20.0
"""Of the search over all shifts, which paths do not exceed."""
_PIECE_S, _DRIFT_S = 5.0, 0.15
"""Pieces that are aligned by themselves, and how far: clocks drift, and no run is as late everywhere."""
_OUTSIDE = ("sticks", "position", "velocity")
"""Setpoints from outside of all loops, the outermost first; attitude, rates and thrust are asked for by loops."""


@dataclass(frozen=True)
class Instruments:
    """What tells of each flight how it was moved, apart from its gusts.

    Attributes
    ----------
    repeats : Repeats
    setpoints : tuple of array, shape (time, column), or None
        For each flight what was asked from outside of its loops, where it is known.
    names : tuple of str
        Those setpoints, over all flights.
    """

    repeats: Repeats
    setpoints: tuple[Array | None, ...]
    names: tuple[str, ...]

    @property
    def kind(self) -> Literal["repeats", "setpoints", "none"]:
        """What most can be told from: runs of a path tell more than what was asked for."""
        if self.repeats.likeness:
            return "repeats"
        return "setpoints" if self.names else "none"

    def beside(self, values: Sequence[Array]) -> list[Array | None]:
        """Give the instruments of each flight: of repeats what other runs have there, else what was asked of it.

        Parameters
        ----------
        values : sequence of array, shape (time,)
            Of each flight, at its samples.

        Returns
        -------
        list of array, shape (time, column), or None
            NaN where no other run is; None for a flight without instruments.
        """
        if self.kind != "repeats":
            return list(self.setpoints)
        places = self.repeats.beside
        return [self.repeats.others(number, values)[:, None] if place else None for number, place in enumerate(places)]


def instruments(flights: Sequence[PlaybackFlight]) -> Instruments:
    """Find what moves flights from outside of their loops: other runs of their paths, and setpoints.

    Parameters
    ----------
    flights : sequence of PlaybackFlight
        Of one sampling period.
    """
    outside = [_outside(flight) for flight in flights]
    columns = [
        np.hstack([flight.setpoints[name] for name in names]) if names else None
        for flight, names in zip(flights, outside, strict=True)
    ]
    asked = dict.fromkeys(name for names in outside for name in names)
    return Instruments(repeats(flights), tuple(columns), tuple(asked))


def _outside(flight: PlaybackFlight) -> tuple[str, ...]:
    """Name the setpoints of a flight that move and do not answer its state.

    A velocity alone may be what a loop of position asks for.
    """
    known = [name for name in _OUTSIDE if name in flight.setpoints and np.ptp(flight.setpoints[name], axis=0).any()]
    return () if known == ["velocity"] else tuple(known)


@dataclass(frozen=True)
class Repeats:
    """Flights that repeat each other.

    Attributes
    ----------
    beside : tuple of mapping of int to array, shape (time,)
        For each flight, by number of another: its sample, in parts of one, at each own sample; NaN where there is none.
    likeness : mapping of pair of int to float
        Correlation of flights of the same path, first the smaller number.
    """

    beside: tuple[Mapping[int, Array], ...]
    likeness: Mapping[tuple[int, int], float]

    def paths(self) -> tuple[tuple[int, ...], ...]:
        """Group the flights by path, those of no other flight's left out."""
        groups: list[set[int]] = []
        for pair in self.likeness:
            joined = set(pair).union(*(group for group in groups if group & set(pair)))
            groups = [group for group in groups if not group & joined] + [joined]
        return tuple(tuple(sorted(group)) for group in groups)

    def others(self, number: int, values: Sequence[Array]) -> Array:
        """Average over the other runs what they have at the same places of the path.

        Parameters
        ----------
        number : int
            Of the flight.
        values : sequence of array, shape (time, ...)
            Of each flight, at its samples.

        Returns
        -------
        array, shape (time, ...)
            At the samples of the flight; NaN where no other run is.
        """
        own = values[number]
        total, count = np.zeros_like(own), np.zeros(len(own))
        for other, place in self.beside[number].items():
            inside = np.isfinite(place)
            total[inside] += _between(values[other], place[inside])
            count += inside
        none = count == 0
        return np.where(_column(none, own), np.nan, total / _column(np.maximum(count, 1), own))


def repeats(flights: Sequence[PlaybackFlight]) -> Repeats:
    """Find flights that fly the same path, and align them.

    Velocities, or rates where there are none, are correlated over all shifts; then rates piece by piece, and a straight
    line through the shifts is taken, so that clocks may drift.

    Parameters
    ----------
    flights : sequence of PlaybackFlight
        Of one sampling period; of each the longest stretch is taken.
    """
    found: tuple[dict[int, Array], ...] = tuple({} for _ in flights)
    likeness = {}
    paths = [_path(flight) for flight in flights]
    for one, other in combinations(range(len(flights)), 2):
        shift, alike = _best_shift(paths[one], paths[other], flights[one].motion.period)
        if alike >= _ALIKE:
            likeness[one, other] = alike
            found[one][other] = _aligned(flights[one], flights[other], shift)
            found[other][one] = _inverse(found[one][other], len(flights[other]))
    return Repeats(found, likeness)


def _longest(flight: PlaybackFlight) -> slice:
    return max(flight.stretches, key=lambda part: part.stop - part.start)


def _path(flight: PlaybackFlight) -> Array:
    """Give what shows the path, at the coarse rate, without mean, shape (time, 3)."""
    motion, part = flight.motion, _longest(flight)
    values = (motion.velocity if flight.has_velocity else motion.rate)[part]
    step = _step(motion.period)
    coarse = values[: len(values) // step * step].reshape(-1, step, 3).mean(axis=1)
    return np.asarray(coarse - coarse.mean(axis=0))


def _step(period: float) -> int:
    return max(1, round(1 / (_COARSE_HZ * period)))


def _best_shift(one: Array, other: Array, period: float) -> tuple[float, float]:
    """Find by how many samples the other flight is ahead, and the correlation there."""
    from scipy.signal import correlate

    length = period * _step(period)
    product = sum(correlate(other[:, axis], one[:, axis], method="fft") for axis in range(3))
    ones, others = (np.concatenate([[0.0], np.cumsum((each**2).sum(axis=1))]) for each in (one, other))
    shifts = np.arange(-(len(one) - 1), len(other))
    first, last = np.maximum(0, -shifts), np.minimum(len(one), len(other) - shifts)
    energy = (ones[last] - ones[first]) * (others[last + shifts] - others[first + shifts])
    long_enough = (last - first) * length >= max(_COMMON_S, 0.5 * min(len(one), len(other)) * length)
    alike = np.where(long_enough, product / np.sqrt(np.maximum(energy, np.finfo(float).tiny)), -1.0)
    best = int(np.argmax(alike))
    return float(shifts[best] * _step(period)), float(alike[best])


def _aligned(one: PlaybackFlight, other: PlaybackFlight, shift: float) -> Array:
    """Give the sample of another flight at each sample of one, NaN where there is none, shape (time,)."""
    period = one.motion.period
    own, theirs = _longest(one), _longest(other)
    far, length = round(_DRIFT_S / period) + _step(period), round(_PIECE_S / period)
    middles, shifts, weights = [], [], []
    mine, yours = one.motion.rate[own], other.motion.rate[theirs]
    for first in range(0, len(mine) - length, length // 2):
        begin = first + int(shift) - far
        if begin < 0 or begin + length + 2 * far > len(yours):
            continue
        piece, around = mine[first : first + length], yours[begin : begin + length + 2 * far]
        products = np.array([np.sum(piece * around[late : late + length]) for late in range(2 * far + 1)])
        best = int(np.argmax(products))
        if products[best] <= 0 or not 0 < best < 2 * far:
            continue
        before, at, after = products[best - 1 : best + 2]
        middles.append(first + length / 2)
        shifts.append(int(shift) - far + best + 0.5 * (before - after) / (before - 2 * at + after))
        weights.append(np.sqrt(at))
    samples = np.arange(len(mine))
    line = np.full(len(mine), shift)
    if len(middles) > 2:
        line = np.polyval(np.polyfit(middles, shifts, 1, w=weights), samples)
    place = np.full(len(one), np.nan)
    at = samples + line
    inside = (at >= 0) & (at <= len(yours) - 1)
    place[own][inside] = at[inside] + theirs.start
    return place


def _inverse(place: Array, length: int) -> Array:
    """Turn the samples of another flight by own ones around, shape (length,)."""
    known = np.flatnonzero(np.isfinite(place))
    return np.interp(np.arange(length), place[known], known, left=np.nan, right=np.nan)


def _between(values: Array, place: Array) -> Array:
    """Interpolate values between samples."""
    first = np.minimum(place.astype(np.int64), len(values) - 2)
    share = _column(place - first, values)
    return np.asarray((1 - share) * values[first] + share * values[first + 1])


def _column(values: Array, like: Array) -> Array:
    """Shape values by time to go with arrays of more dimensions."""
    return values.reshape(-1, *[1] * (like.ndim - 1))
