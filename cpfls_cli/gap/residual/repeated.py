"""What of a gap comes again where flights repeat their path, an effect that is missing, and what does not: gusts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.blocks import FEWEST_BLOCKS, jackknife_error
from cpfls_cli.dynamics.rigid_body import inertia_tensor
from cpfls_cli.effects.effect import Columns
from cpfls_cli.gap.balance.balance_system import System, left_over
from cpfls_cli.gap.balance.weak_flight import WeakFlight
from cpfls_cli.playback.balances import BANDS, BANDS_HZ, band_windows, block_length, fitting_bands
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.instruments import Instruments, instruments
from cpfls_cli.weak_form.windows import Recording, Windows


class Band(NamedTuple):
    """Windows, and the frequencies that they pass, about.

    Attributes
    ----------
    low, high : float, Hz
    """

    windows: Windows
    low: float
    high: float


@dataclass(frozen=True)
class ComesAgain:
    """What of a gap comes again in other runs of the same path, by channel and band; the first band is all of them.

    With the gap r of a run and r' of another at the same place of the path, mean squares are over windows and pairs;
    N^2 m^2 and N^2, NaN where unknown.

    Other fields are described at `ComesAgainGroup`.

    Attributes
    ----------
    share, share_error : array, shape (6, band)
        Of the gap that comes again, and its standard error over blocks of the path.
    explained, explained_error : array, shape (6, band)
        Of what the motion takes and comes again, the share that the model explains.
    """

    low: Array
    high: Array
    total: Array
    again: Array
    noise: Array
    taken: Array
    share: Array
    share_error: Array
    explained: Array
    explained_error: Array
    resists: Array
    flights: tuple[str, ...]
    paths: int
    runs: int
    blocks: IntArray


@dataclass(frozen=True)
class RepeatedRuns:
    """Runs of flights that repeat each other, and which of them are held against which.

    Attributes
    ----------
    names : tuple of str
        Of the flights.
    pairs : tuple of (int, int)
        Numbers of runs.
    """

    names: tuple[str, ...]
    given: Instruments
    pairs: tuple[tuple[int, int], ...]
    bands: tuple[Band, ...]

    @classmethod
    def of(cls, recordings: Sequence[Recording], unseen: int = 0) -> Self | None:
        """Find the runs of a path among flights.

        Parameters
        ----------
        recordings : sequence of Recording
            Of one sampling period.
        unseen : int
            How many of them, the last ones, no fit has seen: only pairs with one of these are taken, where there are
            any.

        Returns
        -------
        RepeatedRuns or None
            None where no flight repeats another.
        """
        different = list(without_copies(recordings))
        flights = [LoggedFlight.of(each.name, each.signals).playback for each in recordings]
        given = instruments(flights)
        runs = given.runs
        pairs = [
            pair
            for path in given.repeats.paths()
            for pair in permutations(path, 2)
            if pair[1] in given.repeats.beside[pair[0]] and all(runs[each].flight in different for each in pair)
        ]
        seen = len(recordings) - unseen
        judged = [pair for pair in pairs if any(runs[each].flight >= seen for each in pair)]
        bands = tuple(_bands(recordings[0].signals.period))
        if not pairs or not bands:
            return None
        return cls(tuple(each.name for each in recordings), given, tuple(judged or pairs), bands)

    def split(self, hypothesis: System, linear: Array) -> ComesAgain | None:
        """Split what a model leaves of the balance into what comes again and what does not.

        Parameters
        ----------
        hypothesis : System
            Of the flights that the runs are of.
        linear : array, shape (column,)
            Coefficients of its base.

        Returns
        -------
        ComesAgain or None
            None where the path is too short to tell an error.

        References
        ----------
        Pintelon and Schoukens 2012 (repeated excitation); Efron and Tibshirani 1993, chapter 11 (jackknife).
        """
        flights = hypothesis.flights
        sides = [_sides(left_over(hypothesis, n, linear), flight.inertial) for n, flight in enumerate(flights)]
        found = [self._of_band(band.windows, sides) for band in self.bands]
        blocks = np.array([len(of_band) for of_band in found])
        if blocks[0] < FEWEST_BLOCKS:
            return None
        known = np.all([flight.known for flight in flights], axis=0)[:, None] & (blocks >= FEWEST_BLOCKS)
        values, errors = np.where(known, np.stack([_with_errors(of_band) for of_band in found], axis=-1), np.nan)
        total, again, taken, share, explained = values
        body = flights[0].signals.vehicle
        return ComesAgain(
            low=np.array([band.low for band in self.bands]),
            high=np.array([band.high for band in self.bands]),
            noise=np.where(known, self._noise(flights, sides), np.nan),
            resists=np.array([*np.diag(inertia_tensor(body)), *[body.mass_kg] * 3]),
            flights=tuple(dict.fromkeys(self.names[self.given.runs[number].flight] for number in self.used)),
            paths=sum(not set(path).isdisjoint(self.used) for path in self.given.repeats.paths()),
            runs=len(self.used),
            blocks=blocks,
            total=total,
            again=again,
            taken=taken,
            share=share,
            explained=explained,
            share_error=errors[3],
            explained_error=errors[4],
        )

    @property
    def used(self) -> tuple[int, ...]:
        """Numbers of the runs that are held against others."""
        return tuple(sorted({number for pair in self.pairs for number in pair}))

    def _of_band(self, band: Windows, sides: Sequence[Array]) -> Array:
        """Sum products over the windows of all pairs, by block of the paths, shape (block, 4, 6)."""
        repeats, cut = self.given.repeats, [sides[run.flight][run.part] for run in self.given.runs]
        # Blocks of all paths are no shorter than the windows.
        samples = sum(len(self.given.flown[path[0]]) for path in repeats.paths())
        length = max(block_length(samples * band.period) / band.period, float(len(band.weight)))
        found: dict[tuple[int, int], Array] = {}
        for number, other in self.pairs:
            middles = np.arange(band.count(len(cut[number]))) * band.hop + len(band.weight) // 2
            first, place = repeats.path(number, len(cut[number]))
            # Too short a run has no window.
            if not len(middles):
                continue
            mine, theirs = _laid(band, cut[number]), _laid(band, repeats.at(number, other, cut[other]))
            known = np.isfinite(theirs).all(axis=(1, 2)) & np.isfinite(place[middles])
            block = np.where(known, place[middles] // length, -1)
            for each in np.unique(block[known]):
                sums = _products(mine[block == each], theirs[block == each])
                found[first, int(each)] = found.get((first, int(each)), 0.0) + sums
        return np.array(list(found.values())).reshape(-1, 4, 6)

    def _noise(self, flights: Sequence[WeakFlight], sides: Sequence[Array]) -> Array:
        """Estimate the mean squares that white noise leaves of a gap, shape (6, band); NaN behind a filter."""
        numbers = sorted({self.given.runs[number].flight for number in self.used})
        bands = [band.windows.alternating() for band in self.bands]
        squares = [[np.mean(_laid(band, sides[number])[:, 0] ** 2, axis=0) for band in bands] for number in numbers]
        filtered = np.any([np.isfinite(flights[number].cut_off) for number in numbers], axis=0)
        return np.where(filtered[:, None], np.nan, np.mean(squares, axis=0).T)


def _with_errors(sums: Array) -> Array:
    """Compute shares over all blocks and their standard errors, shapes (block, 4, 6) to (2, 5, 6)."""
    whole = sums.sum(axis=0)
    if not len(sums):
        return np.full((2, 5, 6), np.nan)
    return np.array([_shares(whole), jackknife_error(_shares(whole - sums))])


def _shares(sums: Array) -> Array:
    """Compute the means of `ComesAgain` and the shares that follow from sums, shapes (..., 4, 6) to (..., 5, 6)."""
    own, crossed, taken, count = np.moveaxis(sums, -2, 0)
    total, again, moved = (_ratio(each, count) for each in (own, crossed, taken))
    return np.stack([total, again, moved, _ratio(crossed, own), 1 - _ratio(crossed, taken)], axis=-2)


def _ratio(above: Array, below: Array) -> Array:
    return np.divide(above, below, out=np.full_like(above, np.nan), where=below != 0)


def without_copies(recordings: Sequence[Recording]) -> Iterator[int]:
    """Give the numbers of flights without those that are given once more: noise comes again in a copy, too."""
    for number, each in enumerate(recordings):
        if not any(np.array_equal(each.signals.body_rate, one.signals.body_rate) for one in recordings[:number]):
            yield number


def _bands(period: float) -> Iterator[Band]:
    """Make the windows of all bands together and of each, as far as a log is fast enough for them."""
    # Above 6 Hz the noise of a gyroscope leaves little to split.
    fitting = [(band, hz) for band, hz in fitting_bands(period) if band != BANDS[0]]
    if fitting:
        (shortest, _), (_, highest) = fitting[0]
        yield Band(band_windows(period, shortest, None), 0.0, highest)
        yield from (Band(band_windows(period, *band), *hz) for band, hz in fitting)
        # What the longest windows keep, a constant torque or the weight among it.
        yield Band(band_windows(period, BANDS[-1][1], None), 0.0, BANDS_HZ[-1][0])


def _sides(left: Columns, taken: Columns) -> Array:
    """Arrange what is left and what the motion takes, each as momentum and direct term, shape (time, 2, 2, 6)."""
    none = np.zeros_like(left.direct)
    parts = [(none if each.momentum is None else each.momentum, each.direct) for each in (left, taken)]
    return np.stack([np.stack(each, axis=1) for each in parts], axis=1)


def _laid(band: Windows, sides: Array) -> Array:
    """Lay windows over both sides, shape (window, 2, 6)."""
    return band.derivative(sides[:, :, 0]) + band.average(sides[:, :, 1])


def _products(mine: Array, theirs: Array) -> Array:
    """Sum products over windows: own and crossed ones of what is left, crossed ones of what is taken, and count."""
    (left, taken), (there, taken_there) = mine.swapaxes(0, 1), theirs.swapaxes(0, 1)
    count = np.full(left.shape[1], float(len(left)))
    return np.array([(left**2).sum(axis=0), (left * there).sum(axis=0), (taken * taken_there).sum(axis=0), count])
