"""Effects that are small against gusts, found by samples: averages over windows hold how a loop answered a gust."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, groupby, pairwise, permutations
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import BLOCK_S, contiguous, mean_error
from cpfls_cli.effects.effect import Columns, Effect
from cpfls_cli.estimation.estimate import RIDGE
from cpfls_cli.gap.balance.balance_system import System, is_free, residual_along, system
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight, columns_of, nuisance
from cpfls_cli.gap.naming.by_instruments import by_instruments
from cpfls_cli.gap.naming.estimate import NamedFit, estimates_of
from cpfls_cli.gap.naming.ranking import within_bounds
from cpfls_cli.gap.naming.results import Alternative
from cpfls_cli.gap.naming.search import alternative
from cpfls_cli.gap.settings import ERRORS
from cpfls_cli.playback.innovations import ROW_S, STRETCH, Whitening, about_mean, before, predicted, whitening
from cpfls_cli.playback.instruments import Instruments
from cpfls_cli.rounding import ascending
from cpfls_cli.vehicle.settings import VehicleSettings


class _Test(NamedTuple):
    """Numbers of an effect jointly with others, by the past."""

    chance: float  # That all of them are 0.
    linear: Array  # Shape (coefficient,).
    error: Array  # Shape (coefficient,): standard errors.
    without: Array  # Shape (stretch, coefficient): without each stretch of time.


@dataclass(frozen=True)
class _Sampled:
    """A fitted hypothesis along flights by samples."""

    found: NamedFit
    flights: tuple[WeakFlight, ...]
    whitening: Whitening | None
    gusty: BoolArray

    @cached_property
    def hypothesis(self) -> System:
        return system(self.flights, self.found.hypothesis.chosen)

    @cached_property
    def _length(self) -> int:
        """Samples of a row."""
        return max(1, round(ROW_S / self.flights[0].windows.period))

    def _rows(self, columns: Columns, number: int) -> Array:
        """Average columns of a flight over rows, shape (row, 6, ...)."""
        flight, direct, momentum = self.flights[number], columns.direct, columns.momentum
        midway = 0.5 * (direct[1:] + direct[:-1])[: (len(direct) - 1) // self._length * self._length]
        rows = midway.reshape(-1, self._length, *direct.shape[1:]).mean(axis=1)
        if momentum is not None:
            rows += np.diff(momentum[:: self._length], axis=0) / (self._length * flight.windows.period)
        return np.asarray(rows * flight.known.reshape(-1, *[1] * (direct.ndim - 2)))

    @cached_property
    def residual(self) -> list[Array]:
        return self._residual_of(self.hypothesis)

    def _residual_of(self, hypothesis: System) -> list[Array]:
        linear = self.found.estimates.linear
        return [self._rows(residual_along(hypothesis, number, linear), number) for number in range(len(self.flights))]

    @cached_property
    def white(self) -> Whitening:
        return self.whitening or whitening(self.residual, self.gusty)

    @cached_property
    def white_residual(self) -> list[Array]:
        """White residual about the mean of each flight, shape (row, 6)."""
        each = ([self.white.white(rows[:, channel], channel) for channel in range(6)] for rows in self.residual)
        return [about_mean(np.stack(channels, axis=1)) for channels in each]

    @cached_property
    def _slopes(self) -> list[list[Array]]:
        """Follow the shapes of the chosen effects, by differences."""
        values, slopes = self.hypothesis.shape_values, []
        for number, shape in enumerate(self.hypothesis.shapes):
            step = 1e-3 * np.ptp(shape.grid) * (np.arange(len(values)) == number)
            more, less = (self._residual_of(self.hypothesis.with_shapes(values + way * step)) for way in (1, -1))
            size = 2 * step.sum()
            slopes.append([(one - other)[..., None] / size for one, other in zip(less, more, strict=True)])
        return slopes

    def _columns(self, number: int, candidates: Sequence[Candidate]) -> tuple[dict[tuple[int, int], Array], int]:
        """Average over rows of a flight all columns: the config's numbers, chosen effects, their shapes, candidates.

        Result: those that are not 0, by channel and column, which few are; and how many columns there are.
        """
        vehicle, signals = nuisance(), self.hypothesis.signals[number]
        chosen = [each for each in self.hypothesis.chosen if is_free(each)]
        of_vehicle, *own = (self._rows(columns_of(each, signals), number) for each in (vehicle, *chosen, *candidates))
        slopes = [each[number] for each in self._slopes]
        every = np.concatenate([of_vehicle, *own[: len(chosen)], *slopes, *own[len(chosen) :]], axis=2)
        there = np.argwhere(np.isfinite(self.white.scale)[:, None] & every.any(axis=0)).tolist()
        return {(channel, at): every[:, channel, at].copy() for channel, at in there}, every.shape[2]

    @cached_property
    def _motion(self) -> list[Array]:
        """Torque and force of rotors and of inertia, and body rates, of each flight; shape (row, 6, signal)."""
        sides = [
            (Columns(signals.wrench), flight.inertial, Columns(np.tile(signals.body_rate, 2)))
            for flight, signals in zip(self.flights, self.hypothesis.signals, strict=True)
        ]
        return [np.stack([self._rows(each, at) for each in own], axis=2) for at, own in enumerate(sides)]

    def products(self, candidates: Sequence[Candidate]) -> _Products:
        """Multiply what the past predicts of all columns with these and the residual, by stretches of each flight."""
        each = (self._columns(number, candidates) for number in range(len(self.flights)))
        columns, (total, *_) = zip(*each, strict=True)
        widths = [len(own.effect.coefficients) for own in candidates]
        ends = np.cumsum([total - sum(widths), *widths])
        counts = [max(1, round(len(own) / STRETCH)) for own in self.white_residual]
        products = np.zeros((sum(counts), ends[-1], ends[-1] + 1))
        for channel, pairs in groupby(sorted(set[tuple[int, int]]().union(*columns)), key=itemgetter(0)):
            there = list(pairs)
            rows = [
                np.stack([flight.pop(own, np.zeros(len(left))) for own in there], axis=1)
                for flight, left in zip(columns, self.residual, strict=True)
            ]
            place = np.array(there)[:, 1]
            for stretch, (z, x) in zip(products, self._stretches(channel, rows, counts), strict=True):
                stretch[place[:, None], [*place, -1]] += z.T @ x
        in_block = round(BLOCK_S / (STRETCH * self._length * self.flights[0].windows.period), 6)
        block = [np.diff(contiguous(count, max(1, round(count / in_block))), prepend=-1) for count in counts]
        places = tuple(np.arange(*pair) for pair in pairwise(ends))
        return _Products(products, np.flatnonzero(np.concatenate(block)), ends[0], places, self.hypothesis.vehicle)

    def _stretches(
        self, channel: int, columns: Sequence[Array], counts: Sequence[int]
    ) -> Iterator[tuple[Array, Array]]:
        """Give what the past predicts of white columns, and these with the white residual, stretch by stretch.

        `columns`: of each flight, shape (row, column); `counts`: stretches of each.
        """
        white = [self.white.white(own, channel) for own in columns]
        known = predicted([own[:, channel] for own in self._motion], columns, white)
        # What a gust keeps beyond one memory goes with the residual before.
        left = [about_mean(before(own[:, channel])) for own in self.residual]
        share = np.linalg.lstsq(np.concatenate(left), np.concatenate(known))[0]
        flights = zip(counts, known, left, white, self.white_residual, strict=True)
        for count, own, one, each, new in flights:
            both = own - one @ share, np.column_stack([about_mean(each), new[:, channel]])
            yield from zip(*(np.array_split(part, count) for part in both), strict=True)


@dataclass(frozen=True)
class _Products:
    """Products of instruments with columns and residual."""

    each: Array  # Shape (stretch, number, number + 1).
    starts: IntArray  # First stretches of blocks.
    nuisance: int  # Numbers that are free in all tests, the first ones.
    places: tuple[IntArray, ...]  # Numbers of each candidate.
    vehicle: VehicleSettings

    @cached_property
    def _whole(self) -> Array:
        return np.asarray(self.each.sum(axis=0))

    def tested(self, effect: Effect, own: IntArray, others: Sequence[IntArray]) -> _Test:
        """Test an effect jointly with others; numbers beyond a bound at 0 are 0, and beyond another is no effect."""
        slope, score = self._adjusted(own, others)
        # The residual of a column that others are a multiple of is the ridge's.
        kept = np.diagonal(slope.sum(axis=0)) > 10 * RIDGE * np.abs(self._whole[own, own])
        while kept.any():
            found = self._test(slope, score, kept)
            inside, admissible = within_bounds(effect, found.linear, found.error, self.vehicle)
            if not admissible:
                break
            if inside[kept].all():
                return found
            kept = kept & inside
        return _Test(1.0, np.zeros(len(own)), np.zeros(len(own)), np.zeros(score.shape))

    def _test(self, slope: Array, score: Array, kept: BoolArray) -> _Test:
        from scipy.special import chdtrc

        linear, error, without = (np.zeros((*before, len(kept))) for before in ((), (), (len(score),)))
        slope, score = slope[:, kept][:, :, kept], score[:, kept]
        total, inverse = score.sum(axis=0), np.linalg.pinv(slope.sum(axis=0))
        linear[kept] = inverse @ total
        left = score - slope @ linear[kept]
        # Of gusts of several memories something slow is left, which scatters more over blocks than over stretches.
        blocks = np.add.reduceat(left, self.starts)
        slow = float(np.trace(np.linalg.pinv(left.T @ left, hermitian=True) @ blocks.T @ blocks)) / kept.sum()
        # By one step without each stretch.
        apart = np.sqrt(max(1.0, slow)) * left @ inverse.T
        without[:, kept] = linear[kept] - apart
        error[kept] = np.sqrt((apart**2).sum(axis=0))
        spread = max(1.0, slow) * score.T @ score
        chance = float(chdtrc(kept.sum(), total @ np.linalg.pinv(spread, hermitian=True) @ total))
        return _Test(chance, linear, error, without)

    def confirms(self, own: IntArray, others: Sequence[IntArray], linear: Array) -> bool:
        """Check that numbers of an effect, shape (coefficient,), surely leave less to the past in these flights."""
        slope, score = self._adjusted(own, others)
        less = score @ linear - 0.5 * np.einsum("bjk,j,k->b", slope, linear, linear)
        return bool(less.sum() > ERRORS * len(less) * mean_error(less))

    def _adjusted(self, own: IntArray, others: Sequence[IntArray]) -> tuple[Array, Array]:
        """Take off the instruments of numbers what others explain: products with their columns, and the residual."""
        rest, wanted = np.concatenate([np.arange(self.nuisance), *others]), np.append(own, -1)
        rest = rest[self._whole[rest, rest] > 0]
        size = np.sqrt(self._whole[rest, rest])
        free = self._whole[np.ix_(rest, rest)] / np.outer(size, size) + RIDGE * np.eye(len(rest))
        less = np.linalg.solve(free.T, (self._whole[np.ix_(own, rest)] / size).T).T / size
        adjusted = self.each[:, own[:, None], wanted] - less @ self.each[:, rest[:, None], wanted]
        return adjusted[..., :-1], adjusted[..., -1]


class SmallEffect(NamedTuple):
    """An effect that is significant by samples, with its numbers and its rivals."""

    candidate: Candidate
    chance: float  # P-value over all that were tried.
    linear: Array  # Shape (coefficient,).
    without: Array  # Shape (block, coefficient): without each block.
    rivals: tuple[Alternative, ...]


def with_small_effects(found: NamedFit, small: Sequence[SmallEffect], given: Instruments) -> NamedFit:
    """Add small effects to a fit, with their numbers by samples; all others follow by instruments."""
    hypothesis = system(found.hypothesis.flights, [*found.hypothesis.chosen, *(each.candidate for each in small)])
    values = np.concatenate([found.estimates.linear, *(each.linear for each in small), found.hypothesis.shape_values])
    start = _numbered(found._replace(hypothesis=hypothesis), values, small)
    # Of all others the errors are those that they had.
    first, own = len(found.estimates.linear), np.concatenate([each.linear for each in small])
    others = np.insert(found.estimates.left_out, [first] * len(own), own, axis=1)
    left_out = np.vstack([others, start.estimates.left_out])
    fit = by_instruments(start._replace(estimates=replace(start.estimates, left_out=left_out)), given)
    return _numbered(fit, fit.values, small)


def _numbered(found: NamedFit, values: Array, small: Sequence[SmallEffect]) -> NamedFit:
    """Give the last effects their numbers by samples."""
    hypothesis, before = found.hypothesis, found.estimates
    end = hypothesis.base.shape[2]
    own = slice(end - sum(len(each.linear) for each in small), end)
    without = np.tile(values, (len(small[0].without), 1))
    without[:, own] = np.concatenate([each.without for each in small], axis=1)
    values = values.copy()
    values[own] = np.concatenate([each.linear for each in small])
    after = estimates_of(hypothesis, values, without)
    first = len(hypothesis.chosen) - len(small)
    numbers = (*before.effects[:first], *after.effects[first:])
    return found._replace(estimates=replace(after, effects=numbers, parameters=before.parameters))


class _Tried(NamedTuple):
    """A candidate with the places of its numbers, tested jointly with what is named."""

    candidate: Candidate
    own: IntArray
    test: _Test


def small_effects(
    found: NamedFit, held: Sequence[WeakFlight], candidates: Sequence[Candidate], gusty: BoolArray
) -> list[SmallEffect]:
    """Find effects that are significant jointly with a fit, in its flights and in those held out; the surest first.

    `held`: flights held out; `gusty`, shape (6,): channels whose gusts are known.
    """
    here = _Sampled(found, found.hypothesis.flights, None, gusty)
    there = _Sampled(found, tuple(held), here.white, gusty)
    # A flight that is shorter predicts nothing, and is not predicted.
    if min((len(own) for each in (here, there) for own in each.white_residual), default=0) < STRETCH:
        return []
    learned, named = here.products(candidates), list[tuple[_Tried, tuple[Alternative, ...]]]()
    while True:
        others = [each.own for each, _ in named]
        tried = [
            _Tried(each, own, learned.tested(each.effect, own, others))
            for each, own in zip(candidates, learned.places, strict=True)
            if not any(own is other for other in others)
        ]
        best, rivals = _surest(learned, tried, others, found.settings.significance)
        if best is None:
            break
        unseen = there.products([*(each.candidate for each, _ in named), best.candidate])
        *known, own = unseen.places
        if not unseen.confirms(own, known, best.test.linear):
            break
        named.append((best, rivals))
    small = []
    for each, rivals in named:
        others = [other.own for other, _ in named if other is not each]
        test = learned.tested(each.candidate.effect, each.own, others)
        chance = len(candidates) * each.test.chance
        small.append(SmallEffect(each.candidate, chance, test.linear, test.without, rivals))
    return small


def _surest(
    learned: _Products, tried: Sequence[_Tried], named: Sequence[IntArray], rate: float
) -> tuple[_Tried | None, tuple[Alternative, ...]]:
    """Choose the surest effect that no others replace, and its rivals: each does without the other one.

    Two others may replace one that none of them replaces alone: inflow and rotor drag damp all rates. Of rivals the
    first of the catalogue is chosen, which is the usual one. None where an effect with shapes is to be chosen: it would
    have to be sought at all of them.
    """
    sure = ascending((each for each in tried if each.test.chance <= rate), lambda each: each.test.chance)
    if not sure or len(tried) * sure[0].test.chance > rate:
        return None, ()

    def is_unneeded(one: int, *others: int) -> bool:
        """Check whether one of the sure effects may be 0 where others are free."""
        jointly = [*named, *(sure[other].own for other in others)]
        return learned.tested(sure[one].candidate.effect, sure[one].own, jointly).chance > rate

    unneeded = np.zeros((len(sure), len(sure)), dtype=bool)
    for one, other in permutations(range(len(sure)), 2):
        unneeded[one, other] = is_unneeded(one, other)
    over_all = np.array([len(tried) * each.test.chance <= rate for each in sure])
    unbeaten = over_all & ~(unneeded & ~unneeded.T).any(axis=1)
    for one in np.flatnonzero(unbeaten).tolist():
        able = np.flatnonzero(over_all & ~unneeded[one] & ~unneeded[:, one])
        pairs = ((a, b) for a, b in combinations(able[able != one].tolist(), 2) if is_unneeded(one, a, b))
        unbeaten[one] = not any(not (is_unneeded(a, b, one) or is_unneeded(b, a, one)) for a, b in pairs)
    if not unbeaten.any():
        return None, ()
    alike = unneeded[best := int(np.argmax(unbeaten))] & unneeded[:, best]
    alike[best] = True
    chosen = min(
        (sure[place] for place in np.flatnonzero(alike & unbeaten)), key=lambda each: each.candidate.effect.order
    )
    if chosen.candidate.effect.shapes:
        return None, ()
    rivals = [sure[place].candidate.effect for place in np.flatnonzero(alike) if sure[place] is not chosen]
    return chosen, tuple(alternative(chosen.candidate.effect, each, 1.0) for each in rivals)
