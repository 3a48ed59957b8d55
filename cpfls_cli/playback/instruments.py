"""What moves a vehicle and knows nothing of its gusts: the same path flown again, or what was asked from outside."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise
from typing import Literal, NamedTuple

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from cpfls_cli.arrays import Array
from cpfls_cli.lag import best_delay, delayed
from cpfls_cli.playback.flight import PlaybackFlight, motion_at

_ALIKE = 0.7
"""Correlation of changes of the rates, or of the velocity, from which on two flights fly the same path. Unlike paths of
a real vehicle reach 0.6, and runs of one path stay above 0.85 in storms."""
_COMMON_S = 8.0
"""That two flights have in common at least: shorter, unlike paths may look alike, if not what was asked of them."""
_SAME, _FARTHEST = 0.98, 0.6
"""Correlation of what was asked from which on it is the same path, of two flights or of one that is asked it again, and
the share of a flight up to which that is sought."""
_AHEAD = 0.5
"""Mean cosine of the angles between the headings of two runs of a flight from which on they are one: 60 degrees. A body
that is turned otherwise moves otherwise about its own axes, and gusts turn many a body by half of that."""
_COARSE_HZ = 20.0
"""Of the search over all shifts, which paths do not exceed."""
_PIECE_S, _DRIFT_S = 5.0, 0.15
"""Pieces that are aligned by themselves, and how far: clocks drift, and no run is as late everywhere."""
_OUTSIDE = (("sticks",), ("position", "velocity"))
"""Setpoints from outside of all loops, of each kind the first; attitude, rates and thrust are asked for by loops.

A velocity may be what a loop of position asks for: that answers gusts so slowly that it misleads by less than chance.
"""


GivenKind = Literal["repeats", "setpoints", "none"]
"""What separates gusts from what a model lacks."""
InstrumentKind = Literal[GivenKind, "past"]
"""Where nothing moves a vehicle but its loop, the past may separate them."""

_ANSWERED_S = 0.5
"""What was asked for is answered within this time."""
_HELD_M = 1.0
"""How far a vehicle that holds its place may be blown; where the setpoint is left over from before, it flies on."""


class Run(NamedTuple):
    """A flight by its number, or the samples of a part of one that flies its path again and again."""

    flight: int
    part: slice


@dataclass(frozen=True, eq=False)
class Instruments:
    """What shows how each run was moved, apart from its gusts.

    Attributes
    ----------
    runs : tuple of Run
        In the order of the flights.
    flown : tuple of PlaybackFlight
        Each run as a flight.
    repeats : Repeats
        Of the runs.
    setpoints : tuple of array, shape (time, column), or None
        For each run what was asked from outside of its loops, where it is known.
    names : tuple of str
        Those setpoints, over all flights.
    """

    runs: tuple[Run, ...]
    flown: tuple[PlaybackFlight, ...]
    repeats: Repeats
    setpoints: tuple[Array | None, ...]
    names: tuple[str, ...]

    @property
    def kind(self) -> GivenKind:
        """What identifies most: runs of a path show more than what was asked for."""
        if self.repeats.likeness:
            return "repeats"
        return "setpoints" if self.names else "none"

    @property
    def flights(self) -> frozenset[int]:
        """Numbers of the flights that have instruments."""
        if self.kind == "repeats":
            return frozenset(self.runs[number].flight for path in self.repeats.paths() for number in path)
        return frozenset(run.flight for run, asked in zip(self.runs, self.setpoints, strict=True) if asked is not None)

    def by_flight(self, values: Sequence[Array]) -> list[Array | None]:
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
        cut = [values[run.flight][run.part] for run in self.runs]
        found: list[Array | None] = [None] * len(values)
        for number, run in enumerate(self.runs):
            asked = self.setpoints[number]
            known = self.repeats.others(number, cut)[:, None] if self.kind == "repeats" else asked
            if known is not None and run.flight in self.flights:
                columns = found[run.flight]
                if columns is None:
                    columns = np.full((len(values[run.flight]), known.shape[1]), np.nan)
                columns[run.part] = known
                found[run.flight] = columns
        return found


def instruments(flights: Sequence[PlaybackFlight]) -> Instruments:
    """Find what moves flights from outside of their loops: other runs of their paths, and setpoints.

    Parameters
    ----------
    flights : sequence of PlaybackFlight
        Of one sampling period.
    """
    runs = tuple(Run(number, part) for number, flight in enumerate(flights) for part in _runs(flight))
    flown = tuple(_cut(flights[run.flight], run.part) for run in runs)
    repeating = repeats(flown)
    outside = _of_one_kind(flown, {number for path in repeating.paths() for number in path})
    columns = [
        np.hstack([flight.setpoints[name] for name in names]) if names else None
        for flight, names in zip(flown, outside, strict=True)
    ]
    return Instruments(runs, flown, repeating, tuple(columns), max(outside, key=len, default=()))


def held(flight: PlaybackFlight) -> bool:
    """Tell whether a flight was asked to stay at one place all the time, and was never far from it."""
    asked, position = flight.setpoints.get("position"), flight.motion.position
    return (
        asked is not None
        and flight.has_position
        and not np.ptp(asked, axis=0).any()
        and bool(np.abs(position - np.median(position, axis=0)).max() < _HELD_M)
    )


def past_setpoints(asked: Array, period: float, apart: int) -> Array:
    """Stack setpoints and their past, so many samples apart, shape (time, column)."""
    lags = range(0, max(round(_ANSWERED_S / period), 2 * apart) + 1, apart)
    return np.hstack([delayed(asked, lag, "previous") for lag in lags])


def _runs(flight: PlaybackFlight) -> list[slice]:
    """Cut a flight where what was asked of it begins again; one that is asked its path once stays whole."""
    part, step = _longest(flight), _step(flight.motion.period)
    again = step * _again(_asked(flight), _ahead(flight), flight.motion.period * step)
    if not again:
        return [slice(0, len(flight))]
    begins = [*range(part.start, part.stop - again // 2, again), part.stop]
    # What is left at the end is no run where it is short.
    return [slice(first, min(last, first + again)) for first, last in pairwise(begins)]


def _again(path: Array, ahead: Array, length: float) -> int:
    """Find after how many coarse samples a path begins again with the same heading; 0 where it does not."""
    shifts = range(round(_COMMON_S / length), round(_FARTHEST * len(path))) if path.any() else ()
    alike = np.array([_correlation(path[:-shift], path[shift:]) for shift in shifts])
    pairs = zip(alike, shifts, strict=True)
    alike *= [each >= _SAME and _of_one_heading(ahead[:-shift], ahead[shift:]) for each, shift in pairs]
    if not alike.any():
        return 0
    first = int(np.flatnonzero(alike)[0])
    return shifts[first + int(np.argmax(alike[first : first + round(1 / length)]))]


def _correlation(one: Array, other: Array) -> float:
    return float(np.sum(one * other) / np.sqrt(max(np.sum(one**2) * np.sum(other**2), np.finfo(float).tiny)))


def _cut(flight: PlaybackFlight, part: slice) -> PlaybackFlight:
    """Take a part of a flight as a flight."""
    if part == slice(0, len(flight)):
        return flight
    stretches = [
        slice(max(each.start, part.start) - part.start, min(each.stop, part.stop) - part.start)
        for each in flight.stretches
    ]
    return replace(
        flight,
        motion=motion_at(flight.motion, part),
        speed=flight.speed[part],
        stretches=tuple(each for each in stretches if each.stop - each.start > 1),
        wrench=None if flight.wrench is None else flight.wrench[part],
        specific_force=None if flight.specific_force is None else flight.specific_force[part],
        setpoints={name: values[part] for name, values in flight.setpoints.items()},
    )


def _outside(flight: PlaybackFlight) -> tuple[str, ...]:
    """Name the setpoints of a flight that move and do not answer its state."""
    moves = [name for name, asked in flight.setpoints.items() if np.ptp(asked, axis=0).any()]
    return tuple(known[0] for kind in _OUTSIDE if (known := [name for name in kind if name in moves]))


def _of_one_kind(flights: Sequence[PlaybackFlight], repeated: Collection[int]) -> list[tuple[str, ...]]:
    """Name the setpoints that most samples of flights have, but of repeated ones: one answer is predicted for all."""
    held = [{(name, flight.setpoints[name].shape[1]) for name in _outside(flight)} for flight in flights]
    voting = [number for number in range(len(flights)) if number not in repeated] or range(len(flights))

    def samples(kind: frozenset[tuple[str, int]]) -> tuple[int, int, list[tuple[str, int]]]:
        return sum(len(flights[number]) for number in voting if kind <= held[number]), len(kind), sorted(kind)

    usual = max((frozenset(held[number]) for number in voting if held[number]), key=samples, default=frozenset())
    names = tuple(name for kind in _OUTSIDE for name in kind if name in dict(usual))
    return [names if usual <= own else () for own in held]


@dataclass(frozen=True)
class Repeats:
    """Flights that repeat each other.

    Attributes
    ----------
    places : tuple of mapping of int to array, shape (time,)
        For each flight, by number of another: its sample, in parts of one, at each own sample; NaN where there is none.
    likeness : mapping of pair of int to float
        Correlation of flights of the same path, first the smaller number.
    """

    places: tuple[Mapping[int, Array], ...]
    likeness: Mapping[tuple[int, int], float]

    def paths(self) -> tuple[tuple[int, ...], ...]:
        """Group the flights by path, those of no other flight's left out."""
        groups: list[set[int]] = []
        for pair in self.likeness:
            joined = set(pair).union(*(group for group in groups if group & set(pair)))
            groups = [group for group in groups if not group & joined] + [joined]
        return tuple(tuple(sorted(group)) for group in groups)

    @cached_property
    def _firsts(self) -> dict[int, int]:
        return {number: group[0] for group in self.paths() for number in group}

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
        for other, place in self.places[number].items():
            inside = np.isfinite(place)
            total[inside] += _between(values[other], place[inside])
            count += inside
        none = count == 0
        return np.where(_column(none, own), np.nan, total / _column(np.maximum(count, 1), own))

    def at(self, number: int, other: int, values: Array) -> Array:
        """Give what another run has at the same places of the path.

        Parameters
        ----------
        number, other : int
            Of the flight, and of one that repeats it.
        values : array, shape (time, ...)
            Of the other, at its samples.

        Returns
        -------
        array, shape (time, ...)
            At the samples of the flight; NaN where the other is not.
        """
        place = self.places[number][other]
        inside = np.isfinite(place)
        found = np.full((len(place), *values.shape[1:]), np.nan)
        found[inside] = _between(values, place[inside])
        return found

    def path(self, number: int, length: int) -> tuple[int, Array]:
        """Give the flight that gives a path its time, and its sample at each sample of a flight.

        Parameters
        ----------
        number, length : int
            Of the flight, and of its samples.

        Returns
        -------
        first : int
            The flight itself where no other repeats it.
        place : array, shape (time,)
            NaN where the first is not.
        """
        first = self._firsts.get(number, number)
        return first, self.places[number].get(first, np.arange(length, dtype=float))


def repeats(flights: Sequence[PlaybackFlight]) -> Repeats:
    """Find flights of one sampling period that fly the same path, and align them; of each the longest stretch is taken.

    Velocities and changes of the rates are correlated over all shifts, or else the positions that were asked for; then
    rates piece by piece, and a straight line through the shifts is taken, so that clocks may drift.
    """
    found: tuple[dict[int, Array], ...] = tuple({} for _ in flights)
    likeness = {}
    paths, asked = [_paths(flight) for flight in flights], [_asked(flight) for flight in flights]
    for one, other in combinations(range(len(flights)), 2):
        period = flights[one].motion.period
        shifts = [_best_shift(*pair, period, _COMMON_S) for pair in zip(paths[one], paths[other], strict=False)]
        shift, alike = max(shifts, key=lambda found: found[1])
        if alike < _ALIKE:
            shift, _ = _best_shift(asked[one], asked[other], period, 0.0)
            alike = _same_size(asked[one], asked[other], round(shift / _step(period)))
            alike *= alike >= _SAME
        if alike >= _ALIKE:
            likeness[one, other] = alike
            found[one][other] = _aligned(flights[one], flights[other], shift)
            found[other][one] = _inverse(found[one][other], len(flights[other]))
    return Repeats(found, likeness)


def _longest(flight: PlaybackFlight) -> slice:
    return max(flight.stretches, key=lambda part: part.stop - part.start)


def _paths(flight: PlaybackFlight) -> list[Array]:
    """Give what shows the path, at the coarse rate: how the rates change, and the velocity; shapes (time, column)."""
    shown = [_changes(flight)]
    if flight.has_velocity:
        velocity = _coarse(flight.motion.velocity[_longest(flight)], _step(flight.motion.period))
        shown.append(velocity - velocity.mean(axis=0))
    return shown


def _changes(flight: PlaybackFlight) -> Array:
    """Give changes of roll and pitch rate: gusts are slower than what is asked for, and yaw is mostly theirs."""
    return np.diff(_coarse(flight.motion.rate[_longest(flight), :2], _step(flight.motion.period)), axis=0)


def _asked(flight: PlaybackFlight) -> Array:
    """Give the positions that were asked for, at the coarse rate; all 0 where none were, or one all the time."""
    asked = flight.setpoints.get("position", np.zeros((len(flight), 3)))[_longest(flight)]
    # The mean of equal numbers is not always that number.
    coarse = _coarse(asked - asked[0], _step(flight.motion.period))
    return np.asarray(coarse - coarse.mean(axis=0))


def _ahead(flight: PlaybackFlight) -> Array:
    """Give where the x axis of the body points in the plane, at the coarse rate; all 0 where that is not known."""
    ahead = flight.motion.rotation[_longest(flight), :2, 0] * flight.has_attitude
    return _coarse(ahead, _step(flight.motion.period))


def _of_one_heading(one: Array, other: Array) -> bool:
    return bool(np.sum(one * other) >= _AHEAD * np.sqrt(np.sum(one**2) * np.sum(other**2)))


def _coarse(values: Array, step: int) -> Array:
    """Average signals over a few samples each, shape (time, column)."""
    return np.asarray(values[: len(values) // step * step].reshape(-1, step, values.shape[1]).mean(axis=1))


def _step(period: float) -> int:
    return max(1, round(1 / (_COARSE_HZ * period)))


def _best_shift(one: Array, other: Array, period: float, least_s: float) -> tuple[float, float]:
    """Find by how many samples the other flight is ahead, and how alike they are there, with so much in common."""
    length = period * _step(period)
    count = len(one) + len(other) - 1
    padded = next_fast_len(count, real=True)
    spectrum = (rfft(other, padded, axis=0) * rfft(one[::-1], padded, axis=0)).sum(axis=1)
    product = irfft(spectrum, padded)[:count]
    ones, others = (np.concatenate([[0.0], np.cumsum((each**2).sum(axis=1))]) for each in (one, other))
    shifts = np.arange(-(len(one) - 1), len(other))
    first, last = np.maximum(0, -shifts), np.minimum(len(one), len(other) - shifts)
    energy = (ones[last] - ones[first]) * (others[last + shifts] - others[first + shifts])
    long_enough = (last - first) * length >= max(least_s, 0.5 * min(len(one), len(other)) * length)
    alike = np.where(long_enough, product / np.sqrt(np.maximum(energy, np.finfo(float).tiny)), -1.0)
    best = int(np.argmax(alike))
    return float(shifts[best] * _step(period)), float(alike[best])


def _same_size(one: Array, other: Array, shift: int) -> float:
    """Correlate signals with another that is ahead; less than 1 where it has the same shape and another size."""
    mine, theirs = one[max(0, -shift) :], other[max(0, shift) :]
    common = min(len(mine), len(theirs))
    mine, theirs = mine[:common], theirs[:common]
    return float(2 * np.sum(mine * theirs) / max(np.sum(mine**2) + np.sum(theirs**2), np.finfo(float).tiny))


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
        at, inside = best_delay(int(shift) - far + np.arange(2 * far + 1.0), -products)
        if inside and products.max() > 0:
            middles.append(first + length / 2)
            shifts.append(float(at))
            weights.append(np.sqrt(products.max()))
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
