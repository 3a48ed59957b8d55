"""Balances of torque and force in bands of frequency, with derivatives by each number, beside those of other runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import add

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import contiguous
from cpfls_cli.effects.polynomial import state_terms
from cpfls_cli.playback.evaluation import Evaluated, VehicleAt
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.instruments import Instruments
from cpfls_cli.playback.parameters import FreeNumbers
from cpfls_cli.weak_form.windows import Windows, windows

BANDS = ((0.15, 0.4), (0.3, 0.8), (0.6, 1.6), (1.2, 3.2))
"""Windows in s; the longer average taken from the shorter leaves a band."""
BANDS_HZ = ((2.0, 6.0), (1.0, 3.0), (0.5, 1.5), (0.25, 0.75))
"""The same by frequency, about."""
OVERLAP = 0.75
"""Share that neighbouring windows have in common."""
FOLDS = 5
"""Parts of the flights that are kept aside in turn."""
_OF_FORCE = (*BANDS[1:3], (1.2, None))
"""Forces are seen in slower motion, and the longest windows keep the mean: the weight."""
_BLOCK_S, _LEAST_BLOCK_S, _BLOCKS = 4.0, 2.0, 9
"""Longer than what gusts remember and the longest windows see; the shortest, and how many a short path is cut into."""
_LAG_S, _LAGS = 0.05, 10
"""What was asked for is answered within half a second."""
_RIDGE = 1e-6
"""Of predictions, so that setpoints that hardly differ from each other do no harm."""
_NEAR = 1e-4
"""Step of a derivative by what the rotors' response has, in natural sizes."""


@dataclass(frozen=True)
class Sums:
    """Products of a balance and its derivatives with those of other runs, by block of the path, band and axis.

    Attributes
    ----------
    crossed, own, others : array, shape (block, band, 3, 2 + number, 2 + number)
        With other runs, with itself, and of other runs; what is left comes first, what the motion takes last.
    windows : array, shape (block, band)
    """

    crossed: Array
    own: Array
    others: Array
    windows: Array


@dataclass(frozen=True)
class Balances:
    """Balances of flights, and what of them comes from outside of the loop."""

    free: FreeNumbers
    flights: Sequence[PlaybackFlight]
    given: Instruments

    @cached_property
    def bands(self) -> tuple[tuple[Windows, slice], ...]:
        """Windows, and the rows of torque or force that they are laid over."""
        period = self.flights[0].motion.period
        turning = [(band_windows(period, *band), slice(0, 3)) for band in BANDS]
        pushed = [(band_windows(period, *band), slice(3, 6)) for band in _OF_FORCE]
        return tuple(turning + pushed if self.translates else turning)

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
        """What was asked of each flight that no other repeats, now and until half a second ago."""
        period = self.flights[0].motion.period
        lags = [round(lag * _LAG_S / period) for lag in range(_LAGS)]
        return {
            number: np.hstack([_late(asked, lag) for lag in lags])
            for number, asked in enumerate(self.given.setpoints)
            if asked is not None and not self.given.repeats.beside[number]
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

    def sums(self, values: Array, bands: BoolArray) -> Sums:
        """Sum products at values of the numbers, shape (number,), in some bands; 0 in others."""
        evaluated, size = Evaluated.of(self.free, values), 2 + len(self.free.numbers)
        sides = {number: _sides(evaluated, self.flights[number], terms) for number, terms in self.terms.items()}
        known = [sides.get(number, np.zeros((len(flight), 0))) for number, flight in enumerate(self.flights)]
        others = {number: self.given.repeats.others(number, known) for number in self.path if number not in self.asked}
        found = [
            self._of_band(band, rows, sides, others) if used else {}
            for (band, rows), used in zip(self.bands, bands, strict=True)
        ]
        empty = np.zeros((3, size, size)), np.zeros((3, size, size)), np.zeros((3, size, size)), 0
        blocks = [[each.get(name, empty) for each in found] for name in sorted(set().union(*found))]
        return Sums(*(np.array([[band[part] for band in block] for block in blocks]) for part in range(4)))

    def _of_band(
        self, band: Windows, rows: slice, sides: Mapping[int, Array], others: Mapping[int, Array]
    ) -> dict[tuple[int, int], tuple[Array, Array, Array, int]]:
        """Sum products in a band, by path and block: as in `Sums`, and how many windows."""
        own = {number: _laid(band, self.flights[number], values[:, :, rows]) for number, values in sides.items()}
        there = {number: _laid(band, self.flights[number], values[:, :, rows]) for number, values in others.items()}
        there |= self._expected(band, {number: own[number] for number in self.asked})
        found: dict[tuple[int, int], tuple[Array, Array, Array, int]] = {}
        for number, (first, path) in self.path.items():
            flight, here, beside = self.flights[number], own[number], there[number]
            place = path[_middles(band, flight)]
            known = np.isfinite(beside).all(axis=(1, 2)) & np.isfinite(place)
            block = np.where(known, place * flight.motion.period // self.block_s, -1)
            for each in np.unique(block[known]):
                mine, theirs = here[block == each], beside[block == each]
                sums = _products(theirs, mine), _products(mine, mine), _products(theirs, theirs), len(mine)
                before = found.get((first, int(each)))
                found[first, int(each)] = sums if before is None else tuple(map(add, before, sums))
        return found

    def _expected(self, band: Windows, own: dict[int, Array]) -> dict[int, Array]:
        """Predict balances from what was asked for, each part as the other parts of the flights tell.

        What a flight itself would tell of its gusts is thereby left out, however many numbers predict.
        """
        if not own:
            return {}
        asked = np.concatenate([_averaged(band, self.flights[number], self.asked[number]) for number in own])
        size = asked.std(axis=0)
        asked = np.hstack([np.ones((len(asked), 1)), asked / np.where(size > 0, size, 1.0)])
        balances = np.concatenate(list(own.values()))
        flat, parts = balances.reshape(len(balances), -1), contiguous(len(balances), FOLDS)
        expected = np.empty_like(flat)
        for fold in range(FOLDS):
            rest, aside = asked[parts != fold], parts == fold
            square = rest.T @ rest + _RIDGE * len(rest) * np.eye(asked.shape[1])
            expected[aside] = asked[aside] @ np.linalg.solve(square, rest.T @ flat[parts != fold])
        ends = np.cumsum([len(each) for each in own.values()])[:-1]
        return dict(zip(own, np.split(expected.reshape(balances.shape), ends), strict=True))


def block_length(seconds: float) -> float:
    """Choose how long the blocks of paths of so many seconds are, s."""
    return min(_BLOCK_S, max(seconds / _BLOCKS, _LEAST_BLOCK_S))


def band_windows(period: float, short_s: float, long_s: float | None) -> Windows:
    """Make windows that leave a band: what short ones see less what long ones do; all of it without long ones."""
    short = windows(period, short_s, OVERLAP)
    return short if long_s is None else short.less(windows(period, long_s, OVERLAP))


def _late(values: Array, samples: int) -> Array:
    """Hold signals back by whole samples, shape (time, column)."""
    return np.concatenate([np.repeat(values[:1], samples, axis=0), values[: len(values) - samples]])


def _middles(band: Windows, flight: PlaybackFlight) -> IntArray:
    """Give the sample in the middle of each window, shape (window,)."""
    half = len(band.weight) // 2
    return np.concatenate(
        [
            stretch.start + np.arange(band.count(stretch.stop - stretch.start)) * band.hop + half
            for stretch in flight.stretches
        ]
    )


def _laid(band: Windows, flight: PlaybackFlight, sides: Array) -> Array:
    """Lay windows over what both sides of a balance differ by, shape (window, 3, 2 + number)."""
    parts = [sides[stretch] for stretch in flight.stretches if band.count(stretch.stop - stretch.start)]
    return np.concatenate(
        [np.zeros((0, *sides.shape[2:])), *(band.derivative(part[:, 0]) - band.average(part[:, 1]) for part in parts)]
    )


def _averaged(band: Windows, flight: PlaybackFlight, values: Array) -> Array:
    """Lay windows over signals, shape (window, column)."""
    parts = [values[stretch] for stretch in flight.stretches if band.count(stretch.stop - stretch.start)]
    return np.concatenate([np.zeros((0, values.shape[1])), *(band.average(part) for part in parts)])


def _products(one: Array, other: Array) -> Array:
    """Sum products over windows, shapes (window, 3, number) to (3, number, number)."""
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


def _sides(evaluated: Evaluated, flight: PlaybackFlight, terms: Array) -> Array:
    """Evaluate both sides of the balance and their derivatives by each number in its natural size.

    Returns
    -------
    array, shape (time, 2, 6, 2 + number)
        Momentum, of rotation in the body frame and of translation in the world's; torque and force that change it. The
        last column is what the motion alone takes.
    """
    at, motion = evaluated.at, flight.motion
    numbers, mass = at.free.numbers, at.free.vehicle.mass_kg
    rotor, slopes = _rotor_terms(at, flight), np.array([number.scale for number in numbers])
    sides = np.zeros((len(flight), 2, 6, 2 + len(numbers)))
    momentum = motion.rate @ at.inertia
    sides[:, 0, :3, -1], sides[:, 0, 3:, -1] = momentum, mass * motion.velocity
    sides[:, 1, :3, -1] = -np.cross(motion.rate, momentum)
    sides[:, 1, 5, -1] = -mass * at.free.vehicle.gravity_m_s2
    weights = np.stack(
        [at.table, *(np.zeros_like(at.table) if each is None else each for each in evaluated.derivatives)]
    )
    wrench = _wrenches(weights, terms, rotor)
    for place, number in enumerate(numbers):
        if evaluated.derivatives[place] is None:
            ahead = at.values.copy()
            ahead[place] += _NEAR * number.scale
            change = (_rotor_terms(VehicleAt(at.free, ahead), flight) - rotor) / (_NEAR * number.scale)
            wrench[:, :, 1 + place] = _wrenches(at.table[None], terms, change)[:, :, 0]
        turned = evaluated.inertia_derivatives[place]
        if turned.any():
            momentum = motion.rate @ turned
            sides[:, 0, :3, 1 + place] = momentum
            wrench[:, :3, 1 + place] -= np.cross(motion.rate, momentum)
    sides[:, 1, :3, :-1] = wrench[:, :3]
    sides[:, 1, 3:, :-1] = motion.rotation @ wrench[:, 3:]
    sides[..., 1:-1] *= slopes
    sides[..., 0] += sides[..., -1]
    return sides


def _wrenches(weights: Array, terms: Array, rotor: Array) -> Array:
    """Evaluate many weights at once, shape (number, 6, terms, 1 + 4 rotors) to (time, 6, number)."""
    motion, spun = np.nonzero(weights.any(axis=(0, 1)))
    found = (terms[:, motion] * rotor[:, spun]) @ weights[:, :, motion, spun].reshape(-1, len(motion)).T
    return np.asarray(found.reshape(len(terms), len(weights), 6).swapaxes(1, 2))
