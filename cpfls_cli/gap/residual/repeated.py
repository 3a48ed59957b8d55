"""The repeatable part of a gap where flights repeat their path, a missing effect, and the rest: gusts and noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, permutations
from operator import itemgetter
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray, runs
from cpfls_cli.blocks import FEWEST_BLOCKS, block_length, half_width, jackknife_error
from cpfls_cli.effects.effect import Columns
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.balance_system import System, residual_along
from cpfls_cli.gap.balance.noise_floor import negligible
from cpfls_cli.gap.balance.weak_flight import CHANNELS, WeakFlight
from cpfls_cli.gap.residual.air import known_motion
from cpfls_cli.gap.settings import COUNTS
from cpfls_cli.inertia import symmetric
from cpfls_cli.playback.balances import BANDS, BANDS_HZ, band_windows, fitting_bands
from cpfls_cli.playback.instruments import Instruments
from cpfls_cli.result import about, result
from cpfls_cli.weak_form.windows import Windows

_SURE = 1 - 0.05 / 36
"""Confidence from which on something is repeatable: of 36 numbers, chance shall pass none in 95 %."""
OPEN = 0.5  # Share of a gap above which it is not ruled out that it is repeatable.
_LARGEST_ERROR = 0.2
"""Standard error of an explained share above which it says nothing: hardly any motion is repeatable there."""


class Band(NamedTuple):
    """Windows, and the frequencies in Hz that they pass, about."""

    windows: Windows
    low: float
    high: float


class Part(NamedTuple):
    """Neighbouring bands in which a gap is repeatable, and their frequencies in Hz."""

    bands: slice
    low: float
    high: float


def _by_band(text: str, unit: str = "SI") -> Any:
    return about(text, "channel", "band", unit=unit, frame="body (FLU)", gaps=True, brief=False)


@result
class Repeatability:
    """The repeatable part of a gap, by channel and band, from runs of the same path.

    With the gap r of a run and r' of another at the same place of the path, mean squares are over windows and pairs;
    N^2 m^2 and N^2, NaN where unknown.
    """

    SHOWN: ClassVar = ("nothing", "bands_hz", "channels")

    low: Array = about("lower end of each band, about; the first band is all of them", "band", unit="Hz", brief=False)
    high: Array = about("upper end of each band, about", "band", unit="Hz", brief=False)
    total: Array = _by_band("mean square of the gap in a band, (N m)^2 and N^2")
    repeatable: Array = _by_band("mean product of the gap with that of another run at the same place of the path")
    noise: Array = _by_band("mean square of the gap by white sensor noise; NaN where signals were filtered")
    motion: Array = _by_band("repeatable part of the torque or force of the motion, as a mean product")
    share_error: Array = _by_band("standard error of repeatable over total", unit="1")
    explained_error: Array = _by_band("standard error of 1 less repeatable over motion", unit="1")
    resists: Array = about(
        "moments of inertia, kg m^2, and mass, kg", "channel", unit="SI", frame="body (FLU)", brief=False
    )
    flights: tuple[str, ...] = about("flights that repeat each other", "repeating")
    runs: int = about("runs that are compared with others")
    paths: int = about("different paths among them")
    blocks: IntArray = about("blocks of the paths that the errors are from", "band", brief=False)

    @property
    def share(self) -> Array:
        """Repeatable share of the gap, shape (channel, band)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.repeatable / self.total)

    @property
    def share_half(self) -> Array:
        """Half of its 95 % interval, shape (channel, band)."""
        return half_width(self.share_error, self.blocks)

    @property
    def explained(self) -> Array:
        """Explained share of the repeatable motion, shape (channel, band); NaN where hardly any is repeatable."""
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 1 - self.repeatable / self.motion
        return np.where((self.motion > 0) & (self.explained_error < _LARGEST_ERROR), share, np.nan)

    @property
    def sure(self) -> BoolArray:
        """Where a gap is repeatable, beyond chance and what hardly counts, shape (channel, band)."""
        shows = self.share > np.maximum(half_width(self.share_error, self.blocks, _SURE), COUNTS)
        least = negligible(np.clip(np.nan_to_num(self.motion[:, 0]), 0.0, None)) ** 2
        return np.asarray(shows & (self.repeatable > least[:, None]))

    @property
    def known(self) -> list[int]:
        """Indices of the channels that are known."""
        return np.flatnonzero(np.isfinite(self.total[:, 0])).tolist()

    @property
    def repeating(self) -> list[int]:
        """Indices of the channels with a repeatable gap."""
        return np.flatnonzero(self.sure.any(axis=1)).tolist()

    def parts(self, channel: int) -> list[Part]:
        """List neighbouring bands in which a gap is repeatable; all of them where it shows in none alone."""
        sure = self.sure[channel]
        bands = [slice(first + 1, after + 1) for first, after in runs(sure[1:])]
        found = [Part(own, float(self.low[own.stop - 1]), float(self.high[own.start])) for own in bands]
        return found or ([Part(slice(0, 1), float(self.low[0]), float(self.high[0]))] if sure[0] else [])

    def share_in(self, channel: int, part: Part) -> float:
        """Compute the repeatable share of a gap in some bands together, all of it at most."""
        share = np.nansum(self.repeatable[channel, part.bands]) / np.nansum(self.total[channel, part.bands])
        return min(float(share), 1.0)

    def at_most(self, channel: int) -> float:
        """Bound the repeatable share of all of a gap, by 95 %; products that cancel are taken for none."""
        bound = np.maximum(self.share[channel, 0], 0.0) + self.share_half[channel, 0]
        return float(np.clip(np.nan_to_num(bound), 0.0, 1.0))

    @property
    def largest(self) -> tuple[float, int, Part] | None:
        """Largest repeatable share of a gap in a part, with its channel; None where none surely is."""
        pairs = [(channel, part) for channel in self.repeating for part in self.parts(channel)]
        found = [(self.share_in(*pair), *pair) for pair in pairs]
        return max(found, key=lambda each: each[0], default=None)

    def explained_in(self, channel: int, part: Part) -> tuple[float, float] | None:
        """Give the least and largest share of the motion in a part that the model explains, where it explains some."""
        explained = self.explained[channel, part.bands]
        return (float(explained.min()), float(explained.max())) if (explained > COUNTS).all() else None

    def kept_of(self, before: Repeatability, channel: int, part: Part) -> float:
        """Compute the share of the repeatable gap in a part that effects do not explain."""
        after, given = (np.nansum(each.repeatable[channel, part.bands]) for each in (self, before))
        return float(np.clip(after / given, 0.0, 1.0))

    def unexplained_of(self, before: Repeatability) -> dict[int, float]:
        """Give by channel the largest share of the repeatable gap that effects leave; infinite where there was none."""
        shares = {}
        for channel in self.repeating:
            bands = [part.bands for part in self.parts(channel)]
            pairs = [[float(np.nansum(each.repeatable[channel, own])) for each in (before, self)] for own in bands]
            shares[channel] = max(now / then if then > 0 else np.inf for then, now in pairs)
        return shares

    @property
    def sizes(self) -> Array:
        """Root mean square of the gap over inertia or mass, rad/s^2 and m/s^2, shape (channel, band)."""
        return np.asarray(np.sqrt(self.total) / self.resists[:, None])

    @property
    def noise_size(self) -> Array:
        """The same of the noise of the sensors, all bands together, shape (channel,)."""
        return np.asarray(np.sqrt(self.noise[:, 0]) / self.resists)

    @property
    def nothing(self) -> bool:
        """Whether it is known that no part of a gap that matters is repeatable."""
        return not self.repeating and self.most <= OPEN

    @property
    def most(self) -> float:
        """Upper bound of the repeatable share over the channels."""
        return max((self.at_most(channel) for channel in self.known), default=0.0)

    @property
    def non_repeatable(self) -> Array:
        """Root mean square of what is neither repeatable nor sensor noise, rad/s^2 and m/s^2, shape (channel,)."""
        noise = np.nan_to_num(self.noise[:, 0])
        rest = self.total[:, 0] - np.clip(self.repeatable[:, 0], 0.0, None) - noise
        return np.asarray(np.sqrt(np.clip(rest, 0.0, None)) / self.resists)

    @property
    def bands_hz(self) -> Array:
        """Ends of each band, shape (band, 2)."""
        return np.column_stack([self.low, self.high])

    @property
    def channels(self) -> dict[str, dict[str, Any]]:
        """Known channels for machines: of each a list over the bands."""
        values = {
            "gap": np.sqrt(self.total),
            "share": self.share,
            "share_half_width": self.share_half,
            "repeatable": self.sure,
            "noise": np.sqrt(self.noise),
            "explained": self.explained,
        }
        return {
            CHANNELS[index]: {key: each[index] for key, each in values.items()}
            | {"non_repeatable": self.non_repeatable[index]}
            for index in self.known
        }


@dataclass(frozen=True)
class RepeatedRuns:
    """Runs of flights that repeat each other, and which of them are compared with which."""

    names: tuple[str, ...]  # Of the flights.
    given: Instruments
    pairs: tuple[tuple[int, int], ...]  # Numbers of runs.
    bands: tuple[Band, ...]

    @classmethod
    def of(cls, recorded: Sequence[Signals], unseen: int = 0) -> Self | None:
        """Find the runs of a path among flights.

        `recorded`: of one sampling period.
        `unseen`: how many of them, the last ones, no fit has seen: only pairs with one of these are taken, where there
        are any.
        None where no flight repeats another.
        """
        given = known_motion(recorded)
        pairs = [
            pair
            for path in given.repeats.paths()
            for pair in permutations(path, 2)
            if pair[1] in given.repeats.places[pair[0]]
        ]
        seen = len(recorded) - unseen
        judged = [pair for pair in pairs if any(given.runs[each].flight >= seen for each in pair)]
        bands = tuple(_bands(recorded[0].period))
        if not pairs or not bands:
            return None
        return cls(tuple(each.name for each in recorded), given, tuple(judged or pairs), bands)

    def split(self, hypothesis: System, linear: Array) -> Repeatability | None:
        """Split the residual of the balance into its repeatable part and the rest.

        `hypothesis`: of the flights that the runs are of.
        `linear`, shape (column,): coefficients of its base.
        None where the path is too short for an error.
        Reference: Pintelon and Schoukens 2012 (repeated excitation); Efron and Tibshirani 1993, chapter 11 (jackknife).
        """
        flights = hypothesis.flights
        sides = [_sides(residual_along(hypothesis, n, linear), flight.inertial) for n, flight in enumerate(flights)]
        found = self._by_band(sides)
        blocks = np.array([len(of_band) for of_band in found])
        if blocks[0] < FEWEST_BLOCKS:
            return None
        known = np.all([flight.known for flight in flights], axis=0)[:, None] & (blocks >= FEWEST_BLOCKS)
        values, errors = np.where(known, np.stack([_with_errors(of_band) for of_band in found], axis=-1), np.nan)
        total, repeatable, motion, *_ = values
        body = flights[0].signals.vehicle
        return Repeatability(
            low=np.array([band.low for band in self.bands]),
            high=np.array([band.high for band in self.bands]),
            noise=np.where(known, self._noise(flights, sides), np.nan),
            resists=np.array([*np.diag(symmetric(body.inertia_kg_m2)), *[body.mass_kg] * 3]),
            flights=tuple(dict.fromkeys(self.names[self.given.runs[number].flight] for number in self.used)),
            paths=sum(not set(path).isdisjoint(self.used) for path in self.given.repeats.paths()),
            runs=len(self.used),
            blocks=blocks,
            total=total,
            repeatable=repeatable,
            motion=motion,
            share_error=errors[3],
            explained_error=errors[4],
        )

    @property
    def used(self) -> tuple[int, ...]:
        """Numbers of the runs that are compared with others."""
        return tuple(sorted({number for pair in self.pairs for number in pair}))

    def _by_band(self, sides: Sequence[Array]) -> list[Array]:
        """Sum products over the windows of all pairs, by block of the paths, for each band of shape (block, 4, 6)."""
        repeats, cut = self.given.repeats, [sides[run.flight][run.part] for run in self.given.runs]
        bands, found = [band.windows for band in self.bands], [dict[tuple[int, int], Array]() for _ in self.bands]
        samples = sum(len(self.given.flown[path[0]]) for path in repeats.paths())
        for number, pairs in groupby(self.pairs, key=itemgetter(0)):
            first, place = repeats.path(number, len(cut[number]))
            middles = [band.middles([slice(0, len(cut[number]))]) for band in bands]
            # Too short a run has no window.
            long = [at for at, own in enumerate(middles) if len(own)]
            own = {at: bands[at].balance(*cut[number].swapaxes(0, 1)) for at in long}
            for _, other in pairs:
                there = repeats.at(number, other, cut[other]).swapaxes(0, 1)
                for at, mine in own.items():
                    band, theirs, sums = bands[at], bands[at].balance(*there), found[at]
                    # Blocks of all paths are no shorter than the windows.
                    length = max(block_length(samples * band.period) / band.period, float(len(band.weight)))
                    known = np.isfinite(theirs).all(axis=(1, 2)) & np.isfinite(place[middles[at]])
                    block = np.where(known, place[middles[at]] // length, -1)
                    for each in np.unique(block[known]):
                        added = _products(mine[block == each], theirs[block == each])
                        sums[first, int(each)] = sums.get((first, int(each)), 0.0) + added
        return [np.array(list(sums.values())).reshape(-1, 4, 6) for sums in found]

    def _noise(self, flights: Sequence[WeakFlight], sides: Sequence[Array]) -> Array:
        """Estimate the mean squares of a gap by white noise, shape (6, band); NaN behind a filter."""
        numbers = sorted({self.given.runs[number].flight for number in self.used})
        bands = [band.windows.alternating() for band in self.bands]
        squares = [
            [np.mean(band.balance(*sides[number][:, :, 0].swapaxes(0, 1)) ** 2, axis=0) for band in bands]
            for number in numbers
        ]
        filtered = np.any([np.isfinite(flights[number].cut_off) for number in numbers], axis=0)
        return np.where(filtered[:, None], np.nan, np.mean(squares, axis=0).T)


def _with_errors(sums: Array) -> Array:
    """Compute means and shares over all blocks and their standard errors, shapes (block, 4, 6) to (2, 5, 6)."""

    def ratio(above: Array, below: Array) -> Array:
        return np.divide(above, below, out=np.full_like(above, np.nan), where=below != 0)

    def shares(sums: Array) -> Array:
        own, cross, motion, count = np.moveaxis(sums, -2, 0)
        means = [ratio(each, count) for each in (own, cross, motion)]
        return np.stack([*means, ratio(cross, own), 1 - ratio(cross, motion)], axis=-2)

    if not len(sums):
        return np.full((2, 5, 6), np.nan)
    whole = sums.sum(axis=0)
    return np.array([shares(whole), jackknife_error(shares(whole - sums))])


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


def _sides(residual: Columns, motion: Columns) -> Array:
    """Arrange direct term and momentum, each of residual and inertial side, shape (time, 2, 2, 6)."""
    none = np.zeros_like(residual.direct)
    momenta = [none if each.momentum is None else each.momentum for each in (residual, motion)]
    return np.stack([np.stack(each, axis=1) for each in ((residual.direct, motion.direct), momenta)], axis=1)


def _products(mine: Array, theirs: Array) -> Array:
    """Sum over windows the squares of a residual, its products with another run's, those of the motion, and count."""
    (residual, motion), (there, motion_there) = mine.swapaxes(0, 1), theirs.swapaxes(0, 1)
    count = np.full(residual.shape[1], float(len(residual)))
    sums = [each.sum(axis=0) for each in (residual**2, residual * there, motion * motion_there)]
    return np.array([*sums, count])
