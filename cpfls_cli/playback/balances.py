"""Balances of torque and force in bands of frequency, with derivatives by each number, and their instruments."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import ClassVar, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import block_length
from cpfls_cli.effects.polynomial import state_terms
from cpfls_cli.estimation.first_stage import first_stage_fit_by_run
from cpfls_cli.inertia import INERTIA_ENTRIES, symmetric_columns
from cpfls_cli.playback.evaluation import Evaluated, VehicleAt
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.innovations import innovations
from cpfls_cli.playback.instruments import Instruments, past_setpoints
from cpfls_cli.playback.parameters import FreeNumbers
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES, Windows, windows

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
_NEAR = 1e-4
"""Step of a derivative by what the rotors' response has, in natural sizes."""
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

    Attributes
    ----------
    ztx, xtx, ztz : array, shape (block, band, 3, column, column)
    windows : array, shape (block, band)
    """

    ztx: Array
    xtx: Array
    ztz: Array
    windows: Array

    def combined(self, columns: Array) -> Sums:
        """Combine columns, shape (axis, column, combination)."""
        ztx, xtx, ztz = (columns.swapaxes(-1, -2) @ each @ columns for each in self[:3])
        return Sums(ztx, xtx, ztz, self.windows)


class _Factors(NamedTuple):
    """What weights of torque and force multiply: a term of the motion and one of the rotors, by index.

    Attributes
    ----------
    torque : tuple of (str, int, int)
        First the number of the rotors' response that they are differentiated by; empty for none.
    force : tuple of (str, int, int, int)
        Last the body axis along which it acts.
    """

    torque: tuple[tuple[str, int, int], ...]
    force: tuple[tuple[str, int, int, int], ...]

    @classmethod
    def of(cls, evaluated: Evaluated) -> _Factors:
        """List what the weights of a vehicle and their derivatives touch."""
        given = [each for each in evaluated.derivatives if each is not None]
        touched = [("", np.any([evaluated.at.table, *given], axis=0))]
        touched += [(name, evaluated.at.table != 0) for name in _of_response(evaluated)]
        torque = tuple((by, m, r) for by, each in touched for m, r in np.argwhere(each[:3].any(axis=0)).tolist())
        force = tuple((by, m, r, axis) for by, each in touched for axis, m, r in np.argwhere(each[3:]).tolist())
        return cls(torque, force)

    def hold(self, other: _Factors) -> bool:
        """Tell whether all of another are here."""
        return {*other.torque} <= {*self.torque} and {*other.force} <= {*self.force}

    def columns(self, evaluated: Evaluated) -> tuple[Array, Array]:
        """Give the residual of the balances of torque and force, its derivatives, and what the motion takes.

        Returns
        -------
        array, shape (3, 6 + torque, 2 + number)
            Of the entries of the inertia, and of the factors of torque.
        array, shape (1, 1 + force, 2 + number)
            Of the mass, and of the factors of force.
        """
        at, numbers = evaluated.at, evaluated.at.free.numbers
        rows, columns = zip(*INERTIA_ENTRIES, strict=True)
        torque = np.zeros((3, len(rows) + len(self.torque), 2 + len(numbers)))
        force = np.zeros((1, 1 + len(self.force), 2 + len(numbers)))
        torque[:, : len(rows), [0, -1]] = at.inertia[rows, columns][:, None]
        force[:, 0, [0, -1]] = at.free.vehicle.mass_kg
        weights = [("", 0, at.table)]
        for place, (number, slope) in enumerate(zip(numbers, evaluated.derivatives, strict=True), start=1):
            torque[:, : len(rows), place] = number.scale * evaluated.inertia_derivatives[place - 1][rows, columns]
            by, table = (number.name, at.table) if slope is None else ("", slope)
            weights.append((by, place, number.scale * table))
        for by, place, table in weights:
            for row, (name, motion, spun) in enumerate(self.torque, start=len(rows)):
                if name == by:
                    torque[:, row, place] = table[:3, motion, spun]
            for row, (name, motion, spun, axis) in enumerate(self.force, start=1):
                if name == by:
                    force[:, row, place] = table[3 + axis, motion, spun]
        return torque, force


class Signals(NamedTuple):
    """What is balanced along a flight: what changes, shape (time, changing), and what acts, shape (time, acting)."""

    changing: Array
    acting: Array


class WindowedColumns(NamedTuple):
    """Columns of balances, made of averages over windows.

    Attributes
    ----------
    arranged : callable
        From averages of changes and of what acts, shapes (window, column), to columns by axis (window, axis, column).
    residual : array, shape (axis, column)
        Weights of columns that give the residual.
    """

    arranged: Callable[[Array, Array], Array]
    residual: Array

    def __call__(self, band: Windows, flight: PlaybackFlight, signals: Signals) -> Array:
        """Lay windows over what is balanced, shape (window, axis, column)."""
        changed = [band.derivative(signals.changing[part]) for part in _long(band, flight)]
        acted = [band.average(signals.acting[part]) for part in _long(band, flight)]
        none = (np.zeros((0, each.shape[1])) for each in signals)
        return self.arranged(
            *(np.concatenate([empty, *parts]) for empty, parts in zip(none, (changed, acted), strict=True))
        )


class Rows(NamedTuple):
    """Balances of a flight in windows.

    Attributes
    ----------
    number : int
        Of the flight.
    own, known : array, shape (window, axis, column)
        Its columns, and what of them is known from outside of its loop; NaN where nothing is.
    middles : array, shape (window,)
        The sample in the middle of each window.
    """

    number: int
    own: Array
    known: Array
    middles: IntArray


@dataclass
class Balances:
    """Balances of flights, and what of them comes from outside of the loop.

    Both sides are linear in the inertia, the mass and the weights of torque and force. So products are taken of what
    these multiply, and again only where the rotors' response has changed.
    """

    flights: Sequence[PlaybackFlight]
    given: Instruments
    _last: tuple[RotorResponse, _Factors, Sums, Sums] | None = field(default=None, init=False)
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
    def terms(self) -> dict[int, Array]:
        """Terms of the motion along each flight."""
        return {number: _motion_terms(self.flights[number]) for number in self.path}

    @cached_property
    def asked(self) -> dict[int, Array]:
        """What was asked of each flight that no other repeats."""
        return {
            number: asked
            for number, asked in enumerate(self.given.setpoints)
            if asked is not None and not self.given.repeats.places[number]
        }

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

    def sums(self, free: FreeNumbers, values: Array) -> Sums:
        """Sum products at values of the numbers, shape (number,), in their natural sizes.

        Returns
        -------
        Sums
            First column: the residual; then derivatives by each number; last what the motion takes.
        """
        evaluated = Evaluated.of(free, values)
        wanted, response = _Factors.of(evaluated), evaluated.at.response
        if self.of_past or self._last is None or self._last[0] != response or not self._last[1].hold(wanted):
            self._last = response, wanted, *self._summed(evaluated, wanted)
        _, factors, *sums = self._last
        turned, pushed = (
            each.combined(columns) for each, columns in zip(sums, factors.columns(evaluated), strict=True)
        )
        return Sums(*(np.concatenate(pair, axis=1) for pair in zip(turned, pushed, strict=True)))

    def _summed(self, evaluated: Evaluated, factors: _Factors) -> tuple[Sums, Sums]:
        """Sum products of all columns of torque, and of force."""
        rotors = {number: _rotor_terms_by(evaluated, self.flights[number]) for number in self.path}
        residual_torque, residual_force = (columns[..., 0] for columns in factors.columns(evaluated))

        def along(number: int, listed: Sequence[tuple[str, int, int]]) -> Array:
            terms = self.terms[number]
            return np.stack([terms[:, motion] * rotors[number][by][:, spun] for by, motion, spun in listed], axis=1)

        turning = self.products(
            self.bands[: len(self.bands_hz)],
            {number: _of_torque(self.flights[number], along(number, factors.torque)) for number in self.path},
            WindowedColumns(_turned, residual_torque),
        )
        pushing: list[ByBand] = []
        for axis in range(3 if self.translates else 0):
            listed, axes = [each[:3] for each in factors.force], [each[3] for each in factors.force]
            signals = {}
            for number in self.path:
                flight = self.flights[number]
                pushes = flight.motion.rotation[:, axis, axes] * along(number, listed)
                signals[number] = _of_force(flight, axis, evaluated.at.free.vehicle.gravity_m_s2, pushes)
            pushing.append(
                self.products(self.bands[len(self.bands_hz) :], signals, WindowedColumns(_pushed, residual_force))
            )
        names = sorted(set().union(*turning, *(each for by_band in pushing for each in by_band)))
        size = len(INERTIA_ENTRIES) + len(factors.torque), 1 + len(factors.force)
        return _arranged([turning], names, size[0]), _arranged(pushing, names, size[1])

    def products(self, bands: Sequence[Windows], signals: Mapping[int, Signals], windowed: WindowedColumns) -> ByBand:
        """Sum products by band, path and block."""
        others = self._of_other_runs(signals)
        return [self.of_band(self._rows(band, signals, others, windowed)) for band in bands]

    def of_band(self, rows: Iterable[Rows]) -> Mapping[tuple[int, int], tuple[Array, int]]:
        """Sum products of rows of a band."""
        found: dict[tuple[int, int], tuple[Array, int]] = {}
        for number, own, known, middles in rows:
            first, path = self.path[number]
            place = path[middles]
            there = np.isfinite(known).all(axis=(1, 2)) & np.isfinite(place)
            block = np.where(there, place * self.flights[number].motion.period // self.block_s, -1)
            for each in np.unique(block[there]):
                mine, theirs = (taken(values, block == each) for values in (own, known))
                before, count = found.get((first, int(each)), (0.0, 0))
                sums = np.stack([_product(theirs, mine), _product(mine, mine), _product(theirs, theirs)])
                found[first, int(each)] = before + sums, count + len(mine)
        return found

    def _of_other_runs(self, signals: Mapping[int, Signals]) -> dict[int, Signals]:
        """Average what the other runs of its path have at the places of each flight."""
        whole = [
            np.hstack(signals[number]) if number in signals else np.zeros((len(flight), 0))
            for number, flight in enumerate(self.flights)
        ]
        changing = next(iter(signals.values())).changing.shape[1]
        found = {}
        for number in self.path:
            if number not in self.asked:
                others = self.given.repeats.others(number, whole)
                found[number] = Signals(others[:, :changing], others[:, changing:])
        return found

    def _rows(
        self, band: Windows, signals: Mapping[int, Signals], others: Mapping[int, Signals], windowed: WindowedColumns
    ) -> Iterator[Rows]:
        own = {number: windowed(band, self.flights[number], each) for number, each in signals.items()}
        known = {number: windowed(band, self.flights[number], each) for number, each in others.items()}
        known |= self._expected(band, {number: own[number] for number in self.asked})
        for number in self.path:
            yield Rows(number, own[number], known[number], middles_of(band, self.flights[number]))

    def _expected(self, band: Windows, own: dict[int, Array]) -> dict[int, Array]:
        """Predict balances from what was asked for."""
        apart = round(_OF_WINDOW * band.hop / (1 - OVERLAP))
        asked = {
            number: averaged(band, self.flights[number], past_setpoints(self.asked[number], band.period, apart))
            for number in own
        }
        return first_stage_fit_by_run(asked, own)


ByBand = Sequence[Mapping[tuple[int, int], tuple[Array, int]]]
"""By band: ZtX, XtX and ZtZ by path and block, shape (3, axis, column, column), and how many windows."""


def _arranged(axes: Sequence[ByBand], names: Sequence[tuple[int, int]], size: int) -> Sums:
    """Arrange products of all axes at once, or of one after the other; 0 where there are none."""
    bands = len(axes[0]) if axes else 0
    sums, counts = np.zeros((3, len(names), bands, 3, size, size)), np.zeros((len(names), bands))
    for axis, by_band in enumerate(axes):
        rows = slice(None) if len(axes) == 1 else slice(axis, axis + 1)
        for (band, found), (place, name) in product(enumerate(by_band), enumerate(names)):
            if name in found:
                sums[:, place, band, rows], counts[place, band] = found[name]
    return Sums(sums[0], sums[1], sums[2], counts)


def fitting_bands(period: float) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Give the bands whose shortest windows hold enough samples, as windows in s and by frequency in Hz."""
    pairs = zip(BANDS, BANDS_HZ, strict=True)
    return [(band, hz) for band, hz in pairs if round(band[0] / period) >= FEWEST_SAMPLES]


def band_windows(period: float, short_s: float, long_s: float | None) -> Windows:
    """Make windows that leave a band: what short ones see less what long ones do; all of it without long ones."""
    short = windows(period, short_s, OVERLAP)
    return short if long_s is None else short.less(windows(period, long_s, OVERLAP))


def middles_of(band: Windows, flight: PlaybackFlight) -> IntArray:
    """Give the sample in the middle of each window, shape (window,)."""
    half = len(band.weight) // 2
    return np.concatenate(
        [
            stretch.start + np.arange(band.count(stretch.stop - stretch.start)) * band.hop + half
            for stretch in flight.stretches
        ]
    )


def _long(band: Windows, flight: PlaybackFlight) -> list[slice]:
    return [stretch for stretch in flight.stretches if band.count(stretch.stop - stretch.start)]


def _turned(changed: Array, acted: Array) -> Array:
    """Arrange what each entry of the inertia takes of the rotation, and what turns against it."""
    entries = len(INERTIA_ENTRIES)
    takes = symmetric_columns(changed) + acted[:, : 3 * entries].reshape(-1, 3, entries)
    turns = -acted[:, None, 3 * entries :]
    return np.concatenate([takes, np.repeat(turns, 3, axis=1)], axis=2)


def _pushed(changed: Array, acted: Array) -> Array:
    """Arrange what the mass takes, its weight with it, and what pushes against it."""
    return np.concatenate([changed + acted[:, :1], -acted[:, 1:]], axis=1)[:, None]


def _of_torque(flight: PlaybackFlight, turns: Array) -> Signals:
    """Arrange rates, the gyroscopic torque of each entry of the inertia, and what turns."""
    rate = flight.motion.rate
    gyroscopic = np.cross(rate[:, :, None], symmetric_columns(rate), axis=1)
    return Signals(rate, np.hstack([gyroscopic.reshape(len(rate), -1), turns]))


def _of_force(flight: PlaybackFlight, axis: int, gravity: float, pushes: Array) -> Signals:
    """Arrange velocity along an axis of the world, gravity along it, and what pushes."""
    weight = np.full((len(flight), 1), gravity if axis == 2 else 0.0)
    return Signals(flight.motion.velocity[:, [axis]], np.hstack([weight, pushes]))


def averaged(band: Windows, flight: PlaybackFlight, values: Array) -> Array:
    """Lay windows over signals, shape (window, column)."""
    return np.concatenate(
        [np.zeros((0, values.shape[1])), *(band.average(values[part]) for part in _long(band, flight))]
    )


def taken(values: Array, there: BoolArray) -> Array:
    """Take rows: a view where they follow one another, as a copy takes as long as what is made of them."""
    rows = np.flatnonzero(there)
    if len(rows) and rows[-1] - rows[0] + 1 == len(rows):
        return values[rows[0] : rows[-1] + 1]
    return values[rows]


def _product(one: Array, other: Array) -> Array:
    """Sum products over windows, shapes (window, axis, column) to (axis, column, column)."""
    return np.asarray(one.transpose(1, 2, 0) @ other.transpose(1, 0, 2))


def _motion_terms(flight: PlaybackFlight) -> Array:
    motion = flight.motion
    return state_terms(np.einsum("tji,tj->ti", motion.rotation, motion.velocity), motion.rate)


def _rotor_terms(at: VehicleAt, flight: PlaybackFlight) -> Array:
    """Evaluate the terms of the rotors at the samples."""
    terms = np.zeros((len(flight), at.free.table_shape[2]))
    for stretch in flight.stretches:
        terms[stretch] = at.response.terms_at_samples(flight.speed[stretch], flight.motion.period, flight.hold)
    return terms


def _of_response(evaluated: Evaluated) -> list[str]:
    """Name the numbers of the rotors' response."""
    pairs = zip(evaluated.at.free.numbers, evaluated.derivatives, strict=True)
    return [number.name for number, slope in pairs if slope is None]


def _rotor_terms_by(evaluated: Evaluated, flight: PlaybackFlight) -> dict[str, Array]:
    """Evaluate the terms of the rotors, and their derivatives by each number of their response, by name."""
    at = evaluated.at
    found = {"": _rotor_terms(at, flight)}
    for name in _of_response(evaluated):
        ahead, place = at.values.copy(), at.free.index[name]
        step = _NEAR * at.free.numbers[place].scale
        ahead[place] += step
        found[name] = (_rotor_terms(VehicleAt(at.free, ahead), flight) - found[""]) / step
    return found


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

    def products(self, bands: Sequence[Windows], signals: Mapping[int, Signals], windowed: WindowedColumns) -> ByBand:
        """Sum products of innovations with their predictions, fast ones and slow ones."""
        band = bands[0]
        rows = list(self._new(band, signals, windowed))
        count = max(1, round(_SLOW_S / (band.hop * band.period)))
        slow = [_mean_of_last(own.known, count) for own in rows]
        fast = [own._replace(known=own.known - mean) for own, mean in zip(rows, slow, strict=True)]
        return [
            self.of_band(fast),
            self.of_band(own._replace(known=mean) for own, mean in zip(rows, slow, strict=True)),
        ]

    def _new(self, band: Windows, signals: Mapping[int, Signals], windowed: WindowedColumns) -> Iterator[Rows]:
        parts = [
            (number, replace(self.flights[number], stretches=(part,)))
            for number in self.path
            for part in self.flights[number].stretches
        ]
        rows = [windowed(band, flight, signals[number]) for number, flight in parts]
        residual = [np.einsum("wac,ac->wa", own, windowed.residual) for own in rows]
        seen = [averaged(band, flight, _seen(flight)) for _, flight in parts]
        new, known, _ = innovations(rows, residual, seen, _PER_WINDOW, _BEFORE)
        for (number, flight), own, predicted in zip(parts, new, known, strict=True):
            middles = middles_of(band, flight)
            yield Rows(number, own, predicted, middles[len(middles) - len(own) :])


def _seen(flight: PlaybackFlight) -> Array:
    """Give what is measured and moves with torque and force, shape (time, signal)."""
    columns = [flight.motion.rate, flight.speed**2]
    return np.hstack([*columns, flight.motion.velocity] if flight.translates else columns)


def _mean_of_last(values: Array, count: int) -> Array:
    """Average over so many last windows, of the first over as many as there are, shape (window, ...)."""
    sums = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    last = np.arange(1, len(values) + 1)
    first = np.maximum(last - count, 0)
    return np.asarray((sums[last] - sums[first]) / (last - first)[:, None, None])
