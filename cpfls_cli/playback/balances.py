"""Balances of torque and force, polynomials of a vehicle's numbers, in bands of frequency, and their instruments."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, pairwise
from math import prod
from typing import Any, ClassVar, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.blocks import block_length
from cpfls_cli.estimation.estimate import first_stage_fit_by_run
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.playback.evaluation import DRAG_OVER_THRUST, TIMES, ParameterPoint, acting_numbers, inertia_entries
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.innovations import innovations
from cpfls_cli.playback.instruments import Instruments, past_setpoints
from cpfls_cli.playback.parameters import DRAG, LEARNED, LOG_MASS, SLOW, THRUST, FreeNumbers
from cpfls_cli.playback.rotors import TimeOfResponse
from cpfls_cli.playback.windows import Rotors
from cpfls_cli.vehicle.values import (
    ARRAYS,
    Polynomial,
    Tangent,
    Value,
    Vector,
    apply,
    cross,
    scaled,
    subtract,
    transposed,
    value_of,
)
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES, Windows, marked_rows, windows

_MASS = "mass"
_BODY = (*INERTIA_PARAMETERS, _MASS)
"""Numbers of the body that is moved."""


class Column(NamedTuple):
    """What balances are linear in: a product of numbers of the vehicle, along an axis.

    `by` names the time of the rotors' response by which it is differentiated; empty for none.
    """

    axis: int
    factors: tuple[str, ...]
    by: str


class Balanced(NamedTuple):
    """What is balanced along a flight: what changes, whose derivative is taken, and what acts; (time, column) each."""

    changing: Array
    acting: Array


class Form(NamedTuple):
    """Columns of a balance of torque or of force, those of one axis after those of another.

    `changing` are those in which something changes, `acting` those in which something acts.
    """

    columns: tuple[Column, ...]
    changing: IntArray
    acting: IntArray

    @property
    def slices(self) -> list[slice]:
        """Columns of each axis."""
        ends = np.searchsorted([column.axis for column in self.columns], range(4)).tolist()
        return [slice(*pair) for pair in pairwise(ends)]


@dataclass(frozen=True)
class Equations:
    """Balances of torque and force of a vehicle at values of its numbers.

    They are evaluated as polynomials of the numbers, so that they follow at other values too.
    """

    at: ParameterPoint

    def hold(self, other: Equations) -> bool:
        """Check whether those of another vehicle follow: its rotors respond alike, and it has no other numbers."""
        own, free = self.at.free, other.at.free
        # Numbers of a remainder mean something else with other rules; those of no remainder have none.
        rules = own.rules == free.rules or LEARNED.keys().isdisjoint(free.blocks)
        alike = own.vehicle == free.vehicle and rules and self.at.response == other.at.response
        # Only what is not 0 is differentiated by times of the response.
        return alike and {*free.index} <= {*own.index} and (not other.at.times or other._in_use <= self._in_use)

    @property
    def _in_use(self) -> set[str]:
        return {name for name, value in zip(self.at.free.index, self.at.values.tolist(), strict=True) if value}

    @cached_property
    def known(self) -> Mapping[str, Value]:
        """Numbers as they act, those of the body among them, with derivatives by the free numbers, by place."""
        at, index = self.at, self.at.free.index
        number = acting_numbers(at.free, lambda name: Tangent(at.get(name, 0.0), {index[name]: 1.0}))
        known = {name: number(name) for name in (*index, DRAG_OVER_THRUST)}
        known |= dict(zip(INERTIA_PARAMETERS, inertia_entries(at.free, number, ARRAYS), strict=True))
        return known | {_MASS: Tangent(at.mass, {index[LOG_MASS]: at.mass} if LOG_MASS in index else {})}

    def product(self, factors: Sequence[str]) -> Value:
        """Multiply `known` numbers; those that are not there are what they are in a model without them."""
        return prod((self.known.get(name, float(name in (THRUST, DRAG))) for name in factors), start=1.0)

    def along(self, flight: PlaybackFlight, translates: bool) -> tuple[list[Form], list[Balanced]]:
        """Evaluate the balance of torque, and of force if asked for, along a flight."""
        forms, signals = [], []
        for balance in self._balances(flight, translates):
            parts = [
                {
                    Column(axis, factors, by): values
                    for axis, component in enumerate(vector)
                    for factors, by, values in self._terms(component)
                }
                for vector in balance
            ]
            columns = sorted(dict.fromkeys(chain(*parts)), key=lambda column: column.axis)
            filled = [np.empty((len(flight), len(part))) for part in parts]
            for out, part in zip(filled, parts, strict=True):
                for row, values in zip(out.T, part.values(), strict=True):
                    row[:] = values
            forms.append(Form(tuple(columns), *(np.array([columns.index(each) for each in part]) for part in parts)))
            signals.append(Balanced(*filled))
        return forms, signals

    def weights(self, columns: Sequence[Column]) -> Array:
        """Weigh columns so that they give the residual, its derivatives by each number, and what the motion takes.

        Returns
        -------
        array, shape (column, 2 + number)
            Derivatives by numbers in their natural sizes.
        """
        index, scales = self.at.free.index, [number.scale for number in self.at.free.numbers]
        weights = np.zeros((len(columns), 2 + len(scales)))
        for row, (_, factors, by) in zip(weights, columns, strict=True):
            value = self.product(factors)
            slopes: Mapping[int, float] = value.by if isinstance(value, Tangent) else {}
            if by:
                slopes = {index[by]: value_of(value)} if by in index else {}
            else:
                row[0] = value_of(value)
                row[-1] = row[0] if any(name in _BODY for name in factors) else 0.0
            for place, slope in slopes.items():
                row[1 + place] = scales[place] * slope
        return weights

    def _balances(self, flight: PlaybackFlight, translates: bool) -> Iterator[tuple[Vector, Vector]]:
        """Write the balance of torque, body axes, then of force, world axes: what changes, and what acts against it."""
        motion, number = flight.motion, Polynomial.number
        rotation, velocity, rate = motion.rotation.transpose(1, 2, 0), tuple(motion.velocity.T), tuple(motion.rate.T)
        air = apply(transposed(rotation), velocity)
        torque, force = self.at.polynomial.wrench(air, rate, self._rotors(flight))
        xx, yy, zz, xy, xz, yz = map(number, INERTIA_PARAMETERS)
        momentum = apply(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)), rate)
        yield momentum, subtract(cross(rate, momentum), torque)
        if translates:
            weight = number(_MASS) * self.at.free.vehicle.gravity_m_s2
            yield scaled(number(_MASS), velocity), subtract((0, 0, weight), apply(rotation, force))

    def _rotors(self, flight: PlaybackFlight) -> Rotors:
        """Give what drives the vehicle at the samples, with derivatives by the times of the response."""

        def filled(terms: Callable[..., Array], *by: TimeOfResponse) -> Array:
            found = np.zeros((len(flight), 1 + 4 * flight.speed.shape[1]))
            for part in flight.stretches:
                found[part] = terms(flight.speed[part], flight.motion.period, flight.hold, *by)
            return found

        response, index = self.at.response, self.at.free.index
        slopes = {index[name]: filled(response.terms_at_samples, TIMES[name]) for name in self.at.times}
        if SLOW in index:
            # The number is the logarithm of the slow time.
            slopes[index[SLOW]] *= response.slow_s
        return Rotors.of(filled(response.terms_at_samples), slopes)

    def _terms(self, component: Value) -> Iterator[tuple[tuple[str, ...], str, Value]]:
        """List the terms of a polynomial, then the derivatives by times of the response of those that are not 0."""
        for factors, value in Polynomial.of(component).terms.items():
            yield factors, "", value_of(value)
            if isinstance(value, Tangent) and value_of(self.product(factors)):
                for place, slope in value.by.items():
                    yield factors, self.at.free.numbers[place].name, slope


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

    `ztx`, `xtx`, `ztz`: shape (block, band, axis, column, column); `windows`: shape (block, band).
    """

    ztx: Array
    xtx: Array
    ztz: Array
    windows: Array

    @classmethod
    def of(cls, bands: Sequence[tuple[Array, Array]]) -> Sums:
        """Arrange products of bands for one axis, shape (3, block, column, column), with counts of their windows."""
        ztx, xtx, ztz = (np.stack(each, axis=1)[:, :, None] for each in zip(*(own for own, _ in bands), strict=True))
        return cls(ztx, xtx, ztz, np.stack([count for _, count in bands], axis=1))

    @classmethod
    def joined(cls, axes: Sequence[Sums]) -> Sums:
        """Put axes side by side."""
        ztx, xtx, ztz = (np.concatenate(each, axis=2) for each in zip(*(own[:3] for own in axes), strict=True))
        return cls(ztx, xtx, ztz, axes[0].windows)


class Rows(NamedTuple):
    """Balances of a flight in windows.

    `own` are its columns, `known` what of them is known from outside of its loop (NaN where nothing is), shape (window,
    column); `middles` the sample in the middle of each window.
    """

    number: int
    own: Array
    known: Array
    middles: IntArray


class _WindowedBalances(NamedTuple):
    """Equations that were evaluated along all flights, and what is kept of their balances of torque, and of force."""

    equations: Equations
    forms: Sequence[Form]
    kept: Sequence[Any]


@dataclass
class Balances:
    """Balances of flights, and what of them comes from outside of the loop.

    They are polynomials of the numbers of the vehicle. So products are taken of what the numbers' products multiply,
    and again only where the rotors' response has changed.
    """

    flights: Sequence[PlaybackFlight]
    given: Instruments
    _laid: _WindowedBalances | None = field(default=None, init=False)
    of_past: ClassVar[bool] = False
    """Whether they are of innovations, which are others at other values."""

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
        """Sum products at values of the numbers, shape (number,), in their natural sizes.

        Returns
        -------
        Sums
            First column: the residual; then derivatives by each number; last what the motion takes.
        """
        equations = Equations(ParameterPoint(free, values))
        if self._laid is None or not self._laid.equations.hold(equations):
            self._laid = self._lay(equations)
        kinds = [
            self._summed(kept, form, equations.weights(form.columns))
            for form, kept in zip(self._laid.forms, self._laid.kept, strict=True)
        ]
        sums = Sums(*(np.concatenate(each, axis=1) for each in zip(*kinds, strict=True)))
        seen = sums.windows.any(axis=1)
        return Sums(*(each[seen] for each in sums))

    def _lay(self, equations: Equations) -> _WindowedBalances:
        """Evaluate the vehicle along all flights, and reduce what is balanced to what is kept."""
        forms: list[Form] = []
        along: dict[int, list[Balanced]] = {}
        for number in self.path:
            forms, along[number] = equations.along(self.flights[number], self.translates)
        turning = len(self.bands_hz)
        kept = [
            self._reduced(bands, form, {number: each.pop(0) for number, each in along.items()})
            for form, bands in zip(forms, (self.bands[:turning], self.bands[turning:]), strict=False)
        ]
        return _WindowedBalances(equations, forms, kept)

    def _reduced(self, bands: Sequence[Windows], form: Form, signals: Mapping[int, Balanced]) -> Any:
        """Sum products of all columns, by axis."""
        others = self._of_other_runs(signals)
        found = (self.of_band(self._rows(band, signals, others, form), form.slices) for band in bands)
        return [Sums.of(each) for each in zip(*found, strict=True)]

    def _summed(self, kept: Any, form: Form, weights: Array) -> Sums:
        """Sum products of the combinations of columns that weights make."""
        combined = []
        for own, columns in zip(kept, form.slices, strict=True):
            ztx, xtx, ztz = (weights[columns].T @ each @ weights[columns] for each in own[:3])
            combined.append(Sums(ztx, xtx, ztz, own.windows))
        return Sums.joined(combined)

    def of_band(self, rows: Iterable[Rows], slices: Sequence[slice]) -> list[tuple[Array, Array]]:
        """Sum products of columns of each axis by block, shape (3, block, column, column), and count windows."""
        counts, widths = np.zeros(len(self.blocks)), [each.stop - each.start for each in slices]
        sums = [np.zeros((3, len(counts), width, width)) for width in widths]
        for number, own, known, middles in rows:
            first, path = self.path[number]
            place = path[middles]
            block = np.where(np.isfinite(known).all(axis=1), self._block(number, place), -1)
            for each in np.unique(block[block >= 0]).tolist():
                at, rows_there = self.blocks[first, each], marked_rows(block == each)
                mine, theirs = own[rows_there], known[rows_there]
                for axis, columns in zip(sums, slices, strict=True):
                    x, z = mine[:, columns], theirs[:, columns]
                    for total, (one, other) in zip(axis[:, at], ((z, x), (x, x), (z, z)), strict=True):
                        total += one.T @ other
                counts[at] += len(mine)
        return [(axis, counts) for axis in sums]

    def _of_other_runs(self, signals: Mapping[int, Balanced]) -> dict[int, Balanced]:
        """Average what the other runs of its path have at the places of each flight."""
        every = [signals.get(n) or Balanced(*np.zeros((2, len(flight), 0))) for n, flight in enumerate(self.flights)]
        return {
            number: Balanced(*(self.given.repeats.others(number, each) for each in zip(*every, strict=True)))
            for number in self.path
            if number not in self.asked
        }

    def _rows(
        self, band: Windows, signals: Mapping[int, Balanced], others: Mapping[int, Balanced], form: Form
    ) -> Iterator[Rows]:
        own = {number: windowed(band, self.flights[number], form, each) for number, each in signals.items()}
        known = {number: windowed(band, self.flights[number], form, each) for number, each in others.items()}
        known |= self._expected(band, {number: own[number] for number in self.asked})
        for number in self.path:
            yield Rows(number, own[number], known[number], band.middles(self.flights[number].stretches))

    def _expected(self, band: Windows, own: dict[int, Array]) -> dict[int, Array]:
        """Predict balances from what was asked for."""
        apart = round(_OF_WINDOW * band.hop / (1 - OVERLAP))
        asked = {
            number: band.average(past_setpoints(self.asked[number], band.period, apart), self.flights[number].stretches)
            for number in own
        }
        return first_stage_fit_by_run(asked, own)


def fitting_bands(period: float) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Give the bands whose shortest windows hold enough samples, as windows in s and by frequency in Hz."""
    pairs = zip(BANDS, BANDS_HZ, strict=True)
    return [(band, hz) for band, hz in pairs if round(band[0] / period) >= FEWEST_SAMPLES]


def band_windows(period: float, short_s: float, long_s: float | None) -> Windows:
    """Make windows that leave a band: what short ones see less what long ones do; all of it without long ones."""
    short = windows(period, short_s, OVERLAP)
    return short if long_s is None else short.less(windows(period, long_s, OVERLAP))


def windowed(band: Windows, flight: PlaybackFlight, form: Form, signals: Balanced) -> Array:
    """Lay windows over what is balanced, shape (window, column)."""
    acted = band.average(signals.acting, flight.stretches)
    rows = np.zeros((len(acted), len(form.columns)))
    rows[:, form.acting] = acted
    rows[:, form.changing] += band.derivative(signals.changing, flight.stretches)
    return rows


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

    def _reduced(self, bands: Sequence[Windows], form: Form, signals: Mapping[int, Balanced]) -> Any:
        """Average all columns over windows, by stretch, each as its own flight."""
        (band, *_) = bands
        return [
            (
                number,
                part,
                band.average(_seen(part, self.translates), part.stretches),
                windowed(band, part, form, signals[number]),
            )
            for number in self.path
            for part in (replace(self.flights[number], stretches=(each,)) for each in self.flights[number].stretches)
        ]

    def _summed(self, kept: Any, form: Form, weights: Array) -> Sums:
        """Sum products of innovations with their predictions, fast ones and slow ones."""
        (band, *_) = self.bands
        count = max(1, round(_SLOW_S / (band.hop * band.period)))
        rows = list(self._new(band, form, kept, weights))
        slow = [own._replace(known=_mean_of_last(own.known, count)) for own in rows]
        fast = [own._replace(known=own.known - mean.known) for own, mean in zip(rows, slow, strict=True)]
        width = weights.shape[1]
        slices = [slice(axis * width, (axis + 1) * width) for axis in range(3)]
        found = (self.of_band(each, slices) for each in (fast, slow))
        return Sums.joined([Sums.of(each) for each in zip(*found, strict=True)])

    def _new(self, band: Windows, form: Form, kept: Any, weights: Array) -> Iterator[Rows]:
        rows = [np.stack([own[:, axis] @ weights[axis] for axis in form.slices], axis=1) for *_, own in kept]
        seen = [each for _, _, each, _ in kept]
        new, expected, _ = innovations(rows, [own[..., 0] for own in rows], seen, _PER_WINDOW, _BEFORE)
        for (number, part, *_), own, predicted in zip(kept, new, expected, strict=True):
            if len(own):
                middles = band.middles(part.stretches)
                flat, known = (each.reshape(len(own), -1) for each in (own, predicted))
                yield Rows(number, flat, known, middles[len(middles) - len(own) :])


def _seen(flight: PlaybackFlight, translates: bool) -> Array:
    """Give what is measured and moves with torque and force, shape (time, signal)."""
    columns = [flight.motion.rate, flight.speed**2]
    return np.hstack([*columns, flight.motion.velocity] if translates else columns)


def _mean_of_last(values: Array, count: int) -> Array:
    """Average over so many last windows, of the first over as many as there are, shape (window, column)."""
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    last = np.arange(1, len(values) + 1)
    first = np.maximum(last - count, 0)
    return np.asarray((sums[last] - sums[first]) / (last - first)[:, None])
