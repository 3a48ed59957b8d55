"""Balances of torque and force of a vehicle, with derivatives by its numbers, in bands of frequency; instruments."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import ClassVar, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.blocks import block_length
from cpfls_cli.estimation.first_stage import first_stage_fit_by_run
from cpfls_cli.playback.evaluation import TIMES, VehicleAt
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.innovations import innovations
from cpfls_cli.playback.instruments import Instruments, past_setpoints
from cpfls_cli.playback.parameters import SLOW, FreeNumbers
from cpfls_cli.playback.rotors import TimeOfResponse
from cpfls_cli.playback.windows import Rotors
from cpfls_cli.vehicle.values import (
    Tangent,
    Value,
    Vector,
    apply,
    cross,
    scaled,
    subtract,
    times,
    transposed,
    value_of,
    zero,
)
from cpfls_cli.weak_form.resampling import marked_rows
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES, Windows, windows


class Side(NamedTuple):
    """What changes, or what acts, in a balance along a flight.

    `places` are those of columns that are not always 0, of all axes one after another; see `Sums` for those of one.
    `values` has shape (time, column).
    """

    places: IntArray
    values: Array

    @classmethod
    def of(cls, vector: Vector, takes: Vector, at: VehicleAt, samples: int) -> Side:
        """Take a vector with derivatives by numbers, and the part of it that the motion takes."""
        scales, columns = [number.scale for number in at.free.numbers], dict[int, Value]()
        for axis, (value, own) in enumerate(zip(vector, takes, strict=True)):
            first = axis * (2 + len(scales))
            slopes = value.by.items() if isinstance(value, Tangent) else ()
            columns |= {first: value_of(value), first + 1 + len(scales): value_of(own)}
            columns |= {first + 1 + place: times(scales[place], slope) for place, slope in slopes}
        known = {place: column for place, column in columns.items() if not zero(column)}
        values = np.empty((samples, len(known)))
        for row, column in zip(values.T, known.values(), strict=True):
            row[:] = column
        return cls(np.array(list(known), dtype=np.int64), values)


class Balanced(NamedTuple):
    """A balance of torque, or of force, along a flight: what changes, whose derivative is taken, and what acts."""

    changing: Side
    acting: Side

    def windowed(self, band: Windows, flight: PlaybackFlight, width: int) -> Array:
        """Lay windows over it, shape (window, axis, column), with so many columns of an axis."""
        acted = band.average(self.acting.values, flight.stretches)
        rows = np.zeros((len(acted), 3 * width))
        rows[:, self.acting.places] = acted
        rows[:, self.changing.places] += band.derivative(self.changing.values, flight.stretches)
        return rows.reshape(-1, 3, width)


def balances_along(at: VehicleAt, flight: PlaybackFlight, translates: bool) -> Iterator[Balanced]:
    """Balance torque, body axes, then force if asked for, world axes, along a flight, with derivatives by numbers."""
    motion, flown = flight.motion, at.differentiated
    rotation, velocity, rate = motion.rotation.transpose(1, 2, 0), tuple(motion.velocity.T), tuple(motion.rate.T)
    torque, force = flown.wrench(apply(transposed(rotation), velocity), rate, _rotors(at, flight))
    momentum = apply(flown.body.inertia, rate)
    turning = cross(rate, momentum)
    sides = [(momentum, momentum), (subtract(turning, torque), turning)]
    if translates:
        mass = flown.body.mass
        momentum, weight = scaled(mass, velocity), (0, 0, mass * flown.body.gravity)
        sides += [(momentum, momentum), (subtract(weight, apply(rotation, force)), weight)]
    made = [Side.of(*side, at, len(flight)) for side in sides]
    return map(Balanced, made[::2], made[1::2])


def _rotors(at: VehicleAt, flight: PlaybackFlight) -> Rotors:
    """Give what drives the vehicle at the samples, with derivatives by the times of the response."""

    def filled(terms: Callable[..., Array], *by: TimeOfResponse) -> Array:
        found = np.zeros((len(flight), 1 + 4 * flight.speed.shape[1]))
        for part in flight.stretches:
            found[part] = terms(flight.speed[part], flight.motion.period, flight.hold, *by)
        return found

    response, index = at.response, at.free.index
    slopes = {index[name]: filled(response.terms_at_samples, TIMES[name]) for name in at.times}
    if SLOW in index:
        # The number is the logarithm of the slow time.
        slopes[index[SLOW]] *= response.slow_s
    return Rotors.of(filled(response.terms_at_samples), slopes)


BANDS = ((0.08, 0.2), (0.15, 0.4), (0.3, 0.8), (0.6, 1.6), (1.2, 3.2))
"""Windows in s; the longer average taken from the shorter leaves a band."""
BANDS_HZ = ((4.0, 12.0), (2.0, 6.0), (1.0, 3.0), (0.5, 1.5), (0.25, 0.75))
"""The same by frequency, about."""
OVERLAP = 0.75
"""Share that neighbouring windows have in common."""
_OF_FORCE = (*BANDS[2:4], (1.2, None))
"""Forces are seen in slower motion, and the longest windows keep the mean: the weight."""
_OF_WINDOW = 0.25
"""What was asked for is looked at every so often, share of a window."""
_WINDOW_S, _SLOW_S = 0.08, 0.25
"""Windows, as short as samples allow: nothing within one is known when it begins. Predictions are averaged over the
second, which leaves what is slow of them: most effects that a model lacks are in it."""
_PARTED_HZ = 2.0
"""Above predictions are fast, about."""
_PER_WINDOW = round(1 / (1 - OVERLAP))
_BEFORE = range(2 * _PER_WINDOW, 4 * _PER_WINDOW, _PER_WINDOW // 2)
"""What was before ended a whole window before another begins: gusts that remember in more ways than one forget all but
one of them, and logs that were filtered forward and backward what they know of what comes."""


class Sums(NamedTuple):
    """Products of balances X and of what instruments know of them Z, by block of the path, band and axis.

    `ztx`, `xtx`, `ztz`: shape (block, band, axis, column, column), columns being the residual, its derivatives by each
    number in its natural size, and what the motion takes; `windows`: shape (block, band).
    """

    ztx: Array
    xtx: Array
    ztz: Array
    windows: Array


class Rows(NamedTuple):
    """Balances of a flight in windows.

    `own` are its columns, `known` what of them is known from outside of its loop (NaN where nothing is), shape (window,
    axis, column); `middles` the sample in the middle of each window.
    """

    number: int
    own: Array
    known: Array
    middles: IntArray


@dataclass(frozen=True)
class Balances:
    """Balances of flights, and what of them comes from outside of the loop."""

    flights: Sequence[PlaybackFlight]
    given: Instruments
    of_past: ClassVar[bool] = False
    """Whether they are of what is new, which is another thing at other values."""

    @cached_property
    def bands_hz(self) -> tuple[tuple[float, float], ...]:
        """Bands of torque by frequency, about."""
        return tuple(hz for _, hz in fitting_bands(self.flights[0].motion.period))

    @cached_property
    def bands(self) -> tuple[Windows, ...]:
        """Windows of torque, then of force."""
        period = self.flights[0].motion.period
        turning = [band for band, _ in fitting_bands(period)]
        return tuple(band_windows(period, *band) for band in (*turning, *(_OF_FORCE if self.translates else ())))

    @property
    def translates(self) -> bool:
        """Whether forces can be balanced."""
        return all(flight.translates for flight in self.flights)

    @cached_property
    def path(self) -> dict[int, tuple[int, Array]]:
        """The flight that gives a path its time, and its sample at each sample, by number of the flight.

        A flight that no other repeats has a path of its own, where it is known what was asked of it.
        """
        repeated = {number for group in self.given.repeats.paths() for number in group}
        known = [number for number, asked in enumerate(self.given.setpoints) if asked is not None or number in repeated]
        return {number: self.given.repeats.path(number, len(self.flights[number])) for number in known}

    @cached_property
    def asked(self) -> dict[int, Array]:
        """What was asked of each flight that no other repeats."""
        return {
            number: asked
            for number, asked in enumerate(self.given.setpoints)
            if asked is not None and not self.given.repeats.places[number]
        }

    @cached_property
    def _asked_before(self) -> dict[Windows, dict[int, Array]]:
        """What was asked of these flights before, averaged over the windows of each band."""
        found: dict[Windows, dict[int, Array]] = {band: {} for band in self.bands}
        for band, (number, asked) in product(found, self.asked.items()):
            columns = past_setpoints(asked, band.period, round(_OF_WINDOW * band.hop / (1 - OVERLAP)))
            found[band][number] = band.average(columns, self.flights[number].stretches)
        return found

    @property
    def longest_s(self) -> float:
        """Length of the longest stretch of a flight that has instruments."""
        parts = [part for number in self.path for part in self.flights[number].stretches]
        return float(max(part.stop - part.start for part in parts) * self.flights[0].motion.period)

    @cached_property
    def block_s(self) -> float:
        """Length of the blocks of the paths: shorter than usual on short paths, so that there are enough."""
        numbers = {first for first, _ in self.path.values()}
        total = sum(len(self.flights[number]) for number in numbers) * self.flights[0].motion.period
        return block_length(total)

    @cached_property
    def blocks(self) -> dict[tuple[int, int], int]:
        """Places of the blocks of the paths, by path and number."""
        found = set()
        for number, (first, path) in self.path.items():
            block = self._block(number, path)
            found |= {(first, each) for each in np.unique(block[block >= 0]).tolist()}
        return {name: place for place, name in enumerate(sorted(found))}

    def _block(self, number: int, place: Array) -> IntArray:
        """Give the block of each place on the path of a flight; -1 where it is not."""
        block = np.nan_to_num(place, nan=-1.0) * self.flights[number].motion.period // self.block_s
        return np.asarray(np.where(np.isfinite(place), block, -1), dtype=np.int64)

    def sums(self, free: FreeNumbers, values: Array) -> Sums:
        """Sum products at values of the numbers, shape (number,)."""
        at, turning, width, parts = VehicleAt(free, values), len(self.bands_hz), 2 + len(values), []
        along = {number: [*balances_along(at, self.flights[number], self.translates)] for number in self.path}
        for kind, bands in enumerate((self.bands[:turning], self.bands[turning:])[: 1 + self.translates]):
            signals = {number: balances[kind] for number, balances in along.items()}
            parts += [self.of_band(rows, width) for rows in self._rows(bands, signals, width)]
        counts = np.stack([count for _, count in parts], axis=1)
        seen = counts.any(axis=1)
        ztx, xtx, ztz = np.stack([products[:, seen] for products, _ in parts], axis=2)
        return Sums(ztx, xtx, ztz, counts[seen])

    def of_band(self, rows: Iterable[Rows], width: int) -> tuple[Array, Array]:
        """Sum products by block, shape (3, block, axis, column, column), and count windows."""
        counts, sums = np.zeros(len(self.blocks)), np.zeros((3, len(self.blocks), 3, width, width))
        for number, own, known, middles in rows:
            first, path = self.path[number]
            block = np.where(np.isfinite(known).all(axis=(1, 2)), self._block(number, path[middles]), -1)
            for each in np.unique(block[block >= 0]).tolist():
                at, there = self.blocks[first, each], marked_rows(block == each)
                x, z = own[there].swapaxes(0, 1), known[there].swapaxes(0, 1)
                for total, (one, other) in zip(sums, ((z, x), (x, x), (z, z)), strict=True):
                    total[at] += one.swapaxes(1, 2) @ other
                counts[at] += x.shape[1]
        return sums, counts

    def _rows(self, bands: Sequence[Windows], signals: Mapping[int, Balanced], width: int) -> Iterator[list[Rows]]:
        """Lay windows of each band over balances, and over what is known of them."""
        others = {number: self._of_other_runs(number, signals) for number in self.path if number not in self.asked}
        for band in bands:
            own, known = (
                {number: each.windowed(band, self.flights[number], width) for number, each in balances.items()}
                for balances in (signals, others)
            )
            known |= first_stage_fit_by_run(self._asked_before[band], own)
            yield [
                Rows(number, own[number], known[number], band.middles(self.flights[number].stretches))
                for number in self.path
            ]

    def _of_other_runs(self, number: int, signals: Mapping[int, Balanced]) -> Balanced:
        """Average what the other runs of its path have at the places of a flight."""
        repeats, sides = self.given.repeats, zip(*signals.values(), strict=True)
        by_number = [{n: side.values for n, side in zip(signals, each, strict=True)} for each in sides]
        pairs = zip(signals[number], by_number, strict=True)
        return Balanced(*(side._replace(values=repeats.others(number, values)) for side, values in pairs))


def fitting_bands(period: float) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Give the bands whose shortest windows hold enough samples, as windows in s and by frequency in Hz."""
    pairs = zip(BANDS, BANDS_HZ, strict=True)
    return [(band, hz) for band, hz in pairs if round(band[0] / period) >= FEWEST_SAMPLES]


def band_windows(period: float, short_s: float, long_s: float | None) -> Windows:
    """Make windows that leave a band: what short ones see less what long ones do; all of it without long ones."""
    short = windows(period, short_s, OVERLAP)
    return short if long_s is None else short.less(windows(period, long_s, OVERLAP))


class PastBalances(Balances):
    """Balances of innovations along flights, and what the past predicts of them.

    They separate the vehicle from its loop where nothing is repeatable and nothing was asked: nobody knew the
    innovations of a gust before, nor any loop.
    """

    of_past: ClassVar[bool] = True

    @cached_property
    def bands_hz(self) -> tuple[tuple[float, float], ...]:
        """Bands of torque by frequency, about."""
        (band, *_) = self.bands
        return (_PARTED_HZ, 1 / (len(band.weight) * band.period)), (0.0, _PARTED_HZ)

    @cached_property
    def bands(self) -> tuple[Windows, ...]:
        """Windows of torque, then of force; in all bands the same."""
        period = self.flights[0].motion.period
        one = band_windows(period, max(_WINDOW_S, FEWEST_SAMPLES * period), None)
        return (one, one) * (2 if self.translates else 1)

    @cached_property
    def path(self) -> dict[int, tuple[int, Array]]:
        """Each flight is a path of its own."""
        return {number: (number, np.arange(len(flight), dtype=float)) for number, flight in enumerate(self.flights)}

    def _rows(self, bands: Sequence[Windows], signals: Mapping[int, Balanced], width: int) -> Iterator[list[Rows]]:
        """Take innovations of balances with their predictions, fast ones and slow ones, of each stretch as a flight."""
        (band, *_) = bands
        parts = [
            (number, replace(self.flights[number], stretches=(stretch,)))
            for number in self.path
            for stretch in self.flights[number].stretches
        ]
        rows = [signals[number].windowed(band, part, width) for number, part in parts]
        seen = [band.average(_seen(part), part.stretches) for _, part in parts]
        new, expected, _ = innovations(rows, [own[..., 0] for own in rows], seen, _PER_WINDOW, _BEFORE)
        count = max(1, round(_SLOW_S / (band.hop * band.period)))
        slow = [
            Rows(number, own, _mean_of_last(known, count), band.middles(part.stretches)[-len(own) :][: len(own)])
            for (number, part), own, known in zip(parts, new, expected, strict=True)
        ]
        yield [each._replace(known=known - each.known) for each, known in zip(slow, expected, strict=True)]
        yield slow


def _seen(flight: PlaybackFlight) -> Array:
    """Give what is measured and moves with torque and force, shape (time, signal)."""
    columns = [flight.motion.rate, flight.speed**2]
    return np.hstack([*columns, flight.motion.velocity] if flight.translates else columns)


def _mean_of_last(values: Array, count: int) -> Array:
    """Average over so many last windows, of the first over as many as there are, shape (window, axis, column)."""
    sums = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    last = np.arange(1, len(values) + 1)
    first = np.maximum(last - count, 0)
    return np.asarray((sums[last] - sums[first]) / (last - first)[:, None, None])
