"""Effects that are small against gusts, found by samples: averages over windows hold how a loop answered a gust."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, permutations
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import BLOCK_S, mean_error
from cpfls_cli.effects.catalogue.parameter_error import NUMBERS
from cpfls_cli.effects.effect import Columns, Effect
from cpfls_cli.estimation.first_stage import RIDGE
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
    def length(self) -> int:
        """Samples of a row."""
        return max(1, round(ROW_S / self.flights[0].windows.period))

    def rows(self, each: Sequence[Columns]) -> list[Array]:
        """Average columns of each flight over rows, shape (row, 6, ...)."""
        period, rows = self.flights[0].windows.period, []
        for columns, flight in zip(each, self.flights, strict=True):
            direct, momentum = columns.direct, columns.momentum
            total = np.zeros_like(direct)
            np.cumsum(0.5 * period * (direct[1:] + direct[:-1]), axis=0, out=total[1:])
            total = total if momentum is None else total + momentum
            known = flight.known.reshape(-1, *[1] * (direct.ndim - 2))
            rows.append(np.diff(total[:: self.length], axis=0) / (self.length * period) * known)
        return rows

    @cached_property
    def residual(self) -> list[Array]:
        return self._residual_of(self.hypothesis)

    def _residual_of(self, hypothesis: System) -> list[Array]:
        linear = self.found.estimates.linear
        return self.rows([residual_along(hypothesis, number, linear) for number in range(len(self.flights))])

    @cached_property
    def white(self) -> Whitening:
        return self.whitening or whitening(self.residual, self.gusty)

    @cached_property
    def new(self) -> Array:
        """White residual about the mean of each flight, shape (row, 6)."""
        return np.concatenate([about_mean(self.white.white(rows)) for rows in self.residual])

    def of(self, candidate: Candidate) -> list[Array]:
        """Average the columns of a candidate over rows."""
        return self.rows([columns_of(candidate, signals) for signals in self.hypothesis.signals])

    @cached_property
    def nuisance(self) -> list[Array]:
        """Columns of the config's numbers and of the chosen effects, of each flight."""
        vehicle = nuisance()
        stated = np.isin([each.name for each in vehicle.effect.coefficients], list(NUMBERS))
        parts = [[rows[..., stated] for rows in self.of(vehicle)]]
        parts += [self.of(each) for each in self.hypothesis.chosen if is_free(each)]
        return [np.concatenate(each, axis=2) for each in zip(*parts, *self._slopes(), strict=True)]

    def _slopes(self) -> list[list[Array]]:
        """Follow the shapes of the chosen effects, by differences."""
        values, slopes = self.hypothesis.shape_values, []
        for number, shape in enumerate(self.hypothesis.shapes):
            step = 1e-3 * np.ptp(shape.grid) * (np.arange(len(values)) == number)
            more, less = (self._residual_of(self.hypothesis.with_shapes(values + way * step)) for way in (1, -1))
            size = 2 * step.sum()
            slopes.append([(one - other)[..., None] / size for one, other in zip(less, more, strict=True)])
        return slopes

    @cached_property
    def _motion(self) -> list[Array]:
        """What moved before each row: torque and force of rotors and of inertia, and rates; shape (row, 6, signal)."""
        pairs = list(zip(self.flights, self.hypothesis.signals, strict=True))
        wrench = self.rows([Columns(signals.wrench) for _, signals in pairs])
        inertial = self.rows([flight.inertial for flight, _ in pairs])
        rate = self.rows([Columns(np.tile(signals.body_rate, 2)) for _, signals in pairs])
        past = (before(np.stack(each, axis=2)) for each in zip(wrench, inertial, rate, strict=True))
        moved = (rows.reshape(*rows.shape[:2], -1) for rows in past)
        return [np.concatenate([np.ones((len(rows), 6, 1)), rows], axis=2) for rows in moved]

    def products(self, candidates: Sequence[Candidate]) -> _Products:
        """Multiply what the past predicts of all columns with these and the residual, by stretches of a window."""
        each = [self.nuisance, *(self.of(candidate) for candidate in candidates)]
        columns, known = self._predicted([np.concatenate(own, axis=2) for own in zip(*each, strict=True)])
        # What a gust keeps beyond one memory goes with the residual before.
        left = np.concatenate([about_mean(before(rows)) for rows in self.residual]) / self.white.scale[:, None]
        past = np.einsum("tcb,cd->tcdb", left, np.eye(6)).reshape(len(left), 6, -1)
        z = np.concatenate([past, known], axis=2).reshape(-1, past.shape[2] + known.shape[2])
        x = np.concatenate([past, columns], axis=2).reshape(z.shape)
        x = np.column_stack([x, self.new.reshape(-1)])
        ends = [*range(0, len(z), 6 * STRETCH), len(z)]
        products = np.array([z[begin:end].T @ x[begin:end] for begin, end in pairwise(ends)])
        first = past.shape[2] + self.nuisance[0].shape[2]
        widths = np.cumsum([first, *(own[0].shape[2] for own in each[1:])])
        return _Products(products, first, tuple(np.arange(*ends) for ends in pairwise(widths)), self.hypothesis.vehicle)

    def _predicted(self, each: Sequence[Array]) -> tuple[Array, Array]:
        """Whiten columns of each flight, and predict them from the past, each flight by the others."""
        columns = [self.white.white(rows) for rows in each]
        known = [np.zeros_like(rows) for rows in columns]
        for channel in np.flatnonzero(np.isfinite(self.white.scale)):
            there = np.flatnonzero(np.any([rows[:, channel].any(axis=0) for rows in columns], axis=0))
            if not len(there):
                continue
            motion = [own[:, channel] for own in self._motion]
            past = [before(rows[:, channel][:, there]) for rows in each]
            for place, own in enumerate(predicted(motion, past, [rows[:, channel][:, there] for rows in columns])):
                known[place][:, channel, there] = own
        every = (np.concatenate([about_mean(rows) for rows in each]) for each in (columns, known))
        return next(every), next(every)


class _Products(NamedTuple):
    """Products of instruments with columns and residual."""

    each: Array  # Shape (stretch, number, number + 1).
    nuisance: int  # Numbers that are free in all tests, the first ones.
    places: tuple[IntArray, ...]  # Numbers of each candidate.
    vehicle: VehicleSettings

    def tested(self, effect: Effect, own: IntArray, others: Sequence[IntArray]) -> _Test:
        """Test an effect jointly with others; numbers beyond a bound at 0 are 0, and beyond another is no effect."""
        # What is left of a column that others are a multiple of is the ridge's.
        left = np.diagonal(self._adjusted(own, others)[0].sum(axis=0))
        width, kept = len(own), left > 10 * RIDGE * np.abs(self._whole[own, own])
        while kept.any():
            found = self._test(own, others, kept)
            inside, admissible = within_bounds(effect, found.linear, found.error, self.vehicle)
            if not admissible:
                break
            if inside[kept].all():
                return found
            kept = kept & inside
        return _Test(1.0, np.zeros(width), np.zeros(width), np.zeros((len(self.each), width)))

    @property
    def _whole(self) -> Array:
        return np.asarray(self.each.sum(axis=0))

    def _test(self, own: IntArray, others: Sequence[IntArray], kept: BoolArray) -> _Test:
        from scipy.special import chdtrc

        slope, score = self._adjusted(own[kept], others)
        total, inverse = score.sum(axis=0), np.linalg.pinv(slope.sum(axis=0))
        linear, error, without = (np.zeros((*before, len(kept))) for before in ((), (), (len(score),)))
        linear[kept] = inverse @ total
        left = score - slope @ linear[kept]
        # Of gusts of several memories something slow is left, which scatters more over blocks than over stretches.
        blocks = np.add.reduceat(left, np.arange(0, len(left), round(BLOCK_S / (STRETCH * ROW_S))))
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
        rest = np.concatenate([np.arange(self.nuisance), *others])
        whole = self._whole
        rest = rest[whole[rest, rest] > 0]
        size = np.sqrt(whole[rest, rest])
        free = whole[np.ix_(rest, rest)] / np.outer(size, size) + RIDGE * np.eye(len(rest))
        less = np.linalg.solve(free.T, (whole[np.ix_(own, rest)] / size).T).T / size
        adjusted = self.each[:, own] - less @ self.each[:, rest]
        return adjusted[:, :, own], adjusted[..., -1]


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
    fit = by_instruments(start, given)
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
    if not (len(here.new) and len(there.new)):
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
    """Choose the surest effect that no other one replaces, and its rivals: each does without the other one.

    Of these the first of the catalogue, which is the usual one. None where an effect with shapes is to be chosen: it
    would have to be sought at all of them.
    """
    sure = sorted((each for each in tried if each.test.chance <= rate), key=lambda each: each.test.chance)
    if not sure or len(tried) * sure[0].test.chance > rate:
        return None, ()
    unneeded = np.zeros((len(sure), len(sure)), dtype=bool)
    for one, other in permutations(range(len(sure)), 2):
        jointly = learned.tested(sure[one].candidate.effect, sure[one].own, [*named, sure[other].own])
        unneeded[one, other] = jointly.chance > rate
    over_all = np.array([len(tried) * each.test.chance <= rate for each in sure])
    unbeaten = over_all & ~(unneeded & ~unneeded.T).any(axis=1)
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
