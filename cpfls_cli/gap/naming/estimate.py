"""Effects fitted together: parameters with intervals by the jackknife over blocks of time, and which can be named.

Floors are of shape (6,), N m and N, by channel; a weight is the standard deviation of each channel, of shape (6,) or
(window, 6).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import half_width, serial_error
from cpfls_cli.effects.catalogue.parameter_error import NUMBERS
from cpfls_cli.effects.effect import Coefficient, Effect, Shape
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.balance_system import System, system, window_noise
from cpfls_cli.gap.balance.refine import equations, fit, fit_within_bounds, number_columns, refitted
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight
from cpfls_cli.gap.naming.ranking import block_index
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.gap.settings import CLEAR, GapSettings
from cpfls_cli.rounding import tied
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import spoken

_KNOWN_TO = 0.005
"""Share of a number that no flight identifies: mass and arms that it is measured against are hardly known better, and
formulas leave out terms as small."""


@dataclass(frozen=True)
class Estimates:
    """A fitted hypothesis."""

    linear: Array  # Shape (column,): of the base of the hypothesis.
    effects: tuple[tuple[Estimate, ...], ...]  # Of each chosen effect: physical coefficients, then shapes.
    parameters: tuple[Estimate, ...]  # Of the vehicle's own numbers.
    # Each shape (coefficient,): linear coefficients of each chosen effect; empty where it has none.
    of_effect: tuple[Array, ...]
    left_out: Array = field(default_factory=lambda: np.zeros((0, 0)))  # Shape (block, number): without each block.

    @property
    def of_vehicle(self) -> Array:
        """The vehicle's own numbers in `linear`."""
        return self.linear[: len(self.linear) - sum(len(linear) for linear in self.of_effect)]


class NamedFit(NamedTuple):
    """Effects fitted together to flights above their floor."""

    hypothesis: System
    estimates: Estimates
    floor: Array
    settings: GapSettings

    @property
    def values(self) -> Array:
        """Coefficients of the base, then shapes, shape (number,)."""
        return np.concatenate([self.estimates.linear, self.hypothesis.shape_values])

    @property
    def block(self) -> IntArray:
        """Block of each window, shape (window,)."""
        return block_index(self.hypothesis, self.settings)

    @property
    def rms_floors(self) -> Array:
        """Root mean square of the residual of each channel, shape (6,), floors."""
        return size_in_floors(self.hypothesis.residual_at(self.estimates.linear), self.floor)

    def without(self, names: Collection[str]) -> NamedFit:
        """Leave effects out and refit the others."""
        kept = [each for each in self.hypothesis.chosen if each.effect.name not in names]
        return fitted(self.hypothesis.flights, kept, self.floor, self.settings)


def fitted(flights: Sequence[WeakFlight], chosen: Sequence[Candidate], floor: Array, settings: GapSettings) -> NamedFit:
    """Fit effects together within their bounds, with the larger of floor and residual as weights.

    Their shapes are those that fit best jointly, where they fit to the noise.
    """
    start = system(flights, chosen)
    there = refitted(start, channel_weight(start, floor))
    if (_left(there, floor)[1] > CLEAR).any():
        # Formulas that do not fit to the noise would move to the residual: they stay where the search found them.
        there = start
    numbers = estimates(there, channel_weight(there, floor), block_index(there, settings))
    return NamedFit(there, numbers, floor, settings)


def channel_weight(hypothesis: System, floor: Array) -> Array:
    """Take the larger of noise and residual of each channel, shape (window, 6).

    Noise is the floor with what the chosen effects do at random.
    """
    noise, left = _left(hypothesis, floor)
    return np.asarray(noise * np.maximum(1.0, left))


def _left(hypothesis: System, floor: Array) -> tuple[Array, Array]:
    """Estimate the noise of each window, shape (window, 6), and the root mean square of the residual in it, (6,)."""
    residual = hypothesis.residual_at(fit(hypothesis, floor))
    noise = window_noise(hypothesis, residual, floor)
    if (noise > floor).any():
        residual = hypothesis.residual_at(fit(hypothesis, noise))
    return noise, size_in_floors(residual, noise)


def size_in_floors(residual: Array, noise: Array) -> Array:
    """Compute the root mean square of each channel of a residual, shape (window, 6), over its noise, shape (6,)."""
    return np.asarray(np.sqrt(np.mean((residual / noise) ** 2, axis=0)))


def estimates(hypothesis: System, weight: Array, block: IntArray) -> Estimates:
    """Fit a hypothesis with refined shapes and compute confidence intervals of its numbers by the jackknife.

    The jackknife leaves out one block, of those of windows, after another, so it holds for residuals that are
    correlated within blocks and for noise of unequal size; what no flight identifies is added (`_KNOWN_TO`). Shapes
    take part by their derivatives. The numbers of the vehicle are within what a vehicle can have; only where free ones
    are surely beyond it, they are given, because the log is wrong then.

    Reference: JCGM 100:2008, 4.3 (uncertainty of what is assumed).
    """
    free = _estimated(hypothesis, weight, block, *fit_within_bounds(hypothesis, weight))
    linear, held = fit_within_bounds(hypothesis, weight, of_vehicle=True)
    if np.array_equal(linear, free.linear):
        return _with_open_bounds(free, hypothesis, weight, block)
    bounded = _estimated(hypothesis, weight, block, linear, held)
    wrong = any(number.impossible for number in free.parameters if number.name in NUMBERS)
    bounded = replace(bounded, parameters=free.parameters) if wrong else bounded
    return _with_open_bounds(bounded, hypothesis, weight, block)


def _with_open_bounds(found: Estimates, hypothesis: System, weight: Array, block: IntArray) -> Estimates:
    """Give numbers on a bound that may as well be 0 their intervals without bounds: single blocks ask for them.

    They are those of effects of which others of their numbers are surely not 0.
    """
    on_bounds = [_on_bounds(numbers) for numbers in found.effects]
    if not any(on_bounds):
        return found
    without = _without_bounds(hypothesis, weight, block)

    def opened(number: Estimate, free: Estimate) -> Estimate:
        (least, most), value = number.plausible, number.value
        if not (free.low <= 0.0 <= free.high and least <= 0.0 <= most):
            return number
        return replace(number, low=min(value, max(least, free.low)), high=max(value, min(most, free.high)))

    effects = []
    for numbers, free, bounds in zip(found.effects, without.effects, on_bounds, strict=True):
        sure = any(each.low > 0 or each.high < 0 for each in numbers if each not in bounds)
        known = {each.name: each for each in free}
        effects.append(tuple(opened(each, known[each.name]) if sure and each in bounds else each for each in numbers))
    return replace(found, effects=tuple(effects))


def _without_bounds(hypothesis: System, weight: Array, block: IntArray) -> Estimates:
    linear = equations(hypothesis, weight).solve()
    return _estimated(hypothesis, weight, block, linear, np.zeros(len(linear), dtype=bool))


def _on_bounds(numbers: Sequence[Estimate]) -> dict[Estimate, float]:
    """List numbers that are surely on a bound, and this; 0 is no such bound: many coefficients cannot be less."""
    return {
        number: bound
        for number in numbers
        for bound in number.plausible
        if bound and tied(np.array(number.value), np.array(bound)) and not number.low <= 0.0 < number.high
    }


def _estimated(hypothesis: System, weight: Array, block: IntArray, linear: Array, held: BoolArray) -> Estimates:
    """Add confidence intervals to a fit: without each block all numbers change by one Gauss-Newton step."""
    moving = number_columns(hypothesis, linear, system(hypothesis.flights).rotor_wrench)
    rows = equations(hypothesis, weight).around(linear, ~held, moving / weight[..., None])
    length = np.linalg.norm(rows.columns, axis=0)
    scale = np.where(length > 0, length, 1.0)
    scaled, noise = rows.columns / scale, rows.noise[:, :-1] / scale
    of_row = np.repeat(block, len(rows.right) // len(block))
    gram, moment = [], []
    for own in (of_row == number for number in np.unique(block)):
        x, n = scaled[own].T, noise[own].T
        gram.append(x @ x.T - rows.trusted * (n @ n.T))
        moment.append(x @ rows.right[own] - rows.trusted * (n @ rows.noise[own, -1]))
    others = np.sum(gram, axis=0) - np.array(gram) + 1e-9 * np.eye(len(scale))
    values = np.concatenate([linear, hypothesis.shape_values])
    left_out = np.tile(values, (len(gram), 1))
    free = np.append(~held, np.ones(len(values) - len(linear), dtype=bool))
    left_out[:, free] -= np.linalg.solve(others, np.array(moment)[..., None])[..., 0] / scale
    return estimates_of(hypothesis, values, hypothesis.followed(left_out))


def places_of(hypothesis: System) -> list[tuple[slice, slice]]:
    """Say of each chosen effect where its coefficients are in the base, and its shapes behind all of these."""
    in_base = {candidate.key: place for candidate, place in hypothesis.places}
    places, first = list[tuple[slice, slice]](), hypothesis.places[-1][1].stop
    for candidate in hypothesis.chosen:
        shapes = slice(first, first := first + len(candidate.effect.shapes))
        places.append((in_base.get(candidate.key, slice(0)), shapes))
    return places


def estimates_of(hypothesis: System, values: Array, left_out: Array, blocks: int | None = None) -> Estimates:
    """Give numbers from coefficients and shapes, with those of fits that each left one block out.

    `values`, shape (number,): coefficients of the base, then shapes; `left_out`: shape (block, number); `blocks`: how
    many an error is of, None for all of these.
    """
    blocks = len(left_out) if blocks is None else blocks
    rows, vehicle = np.vstack([values, left_out]), hypothesis.vehicle
    (of_vehicle, own), *_ = hypothesis.places
    parameters = _with_intervals(of_vehicle.effect, vehicle, rows[:, own], rows[:, :0], blocks)
    places = list(zip(hypothesis.chosen, places_of(hypothesis), strict=True))
    return Estimates(
        values[: hypothesis.base.shape[2]],
        tuple(
            _with_intervals(each.effect, vehicle, rows[:, linear], rows[:, shapes], blocks)
            for each, (linear, shapes) in places
        ),
        parameters,
        tuple(values[linear] for _, (linear, _) in places),
        left_out,
    )


def _with_intervals(
    effect: Effect, vehicle: VehicleSettings, linear: Array, shapes: Array, blocks: int
) -> tuple[Estimate, ...]:
    """Give numbers of an effect with 95 % confidence intervals: by the jackknife, and what no flight identifies.

    The first row is of all blocks, the others each of all but one.
    """
    if effect.physical and linear.shape[1]:
        linear = np.array([effect.physical.of(row) for row in linear])
    known: tuple[Coefficient | Shape, ...] = (*effect.coefficients[: linear.shape[1]], *effect.shapes)
    value, *without = np.concatenate([linear, shapes], axis=1)
    half = np.full(len(value), np.inf)
    if len(without) > 1:
        # A relative error has the share of the number that it is an error of.
        whole = value + np.isin([one.name for one in known], list(NUMBERS))
        half = np.hypot(half_width(serial_error(np.array(without)), blocks), _KNOWN_TO * whole)
    return tuple(
        within(Estimate(one.name, one.unit, float(v), float(v - h), float(v + h), one.bounds(vehicle)))
        for one, v, h in zip(known, value, half, strict=True)
        # A column of zeros leaves its coefficient open: an offset along x, say, where only x is compared. A shape that
        # follows a number of the vehicle is that number.
        if (one.name not in NUMBERS if one in effect.shapes else np.isfinite(v))
        and (v != 0 or h != 0 or one in effect.shapes or effect.kind == "parameter")
    )


def within(number: Estimate) -> Estimate:
    """End the interval of a number that cannot be below 0 there."""
    return replace(number, low=max(number.low, 0.0)) if number.plausible[0] == 0 <= number.value else number


def sized(effect: Effect, numbers: Sequence[Estimate]) -> list[Estimate]:
    """Keep the numbers that set the size of an effect: its coefficients, or its shapes where it has none."""
    shapes = {shape.name for shape in effect.shapes}
    return [number for number in numbers if (number.name in shapes) == effect.unit_coefficient]


def nothing_by_size(found: NamedFit) -> list[str]:
    """Name the effects whose size does not differ from zero."""
    names = []
    for (effect, _), numbers in zip(found.hypothesis.chosen, found.estimates.effects, strict=True):
        size = sized(effect, numbers)
        if effect.numbers and not any(number.low > 0 or number.high < 0 for number in size):
            names.append(effect.name)
    return names


def effect_sentence(effect: Effect, numbers: Sequence[Estimate], vehicle: VehicleSettings) -> str:
    """Compose the sentence of the catalogue on an effect, and what the numbers that are surely not zero add to it."""
    sure = {number.name: number.value for number in numbers if number.low > 0 or number.high < 0}
    more = "" if effect.describe is None else effect.describe(vehicle, sure)
    return f"{effect.sentence} {more}".rstrip()


class Refusal(NamedTuple):
    """An effect that is no name, and why, as the end of a sentence."""

    name: str
    reason: str
    # Whether others are to be looked for without it: on a bound it may take the place of another one.
    in_the_way: bool = False
    # Whether flights held out are surely worse with it: it is in those that it was found in, and not in these.
    harms: bool = False

    @property
    def sentence(self) -> str:
        """The whole sentence."""
        return f"{CATALOGUE[self.name].title} explains part of the gap, but is not named: {self.reason}"


def earned(
    flights: Sequence[WeakFlight], chosen: Sequence[Candidate], floor: Array, settings: GapSettings
) -> tuple[NamedFit, list[Refusal]]:
    """Fit chosen effects, and refit without those that have not earned a name on the flights that they were found in.

    These are effects whose size does not differ from zero, which are not named, effects that sit on a bound, and those
    that may as well be another one.
    """
    found, refusals = fitted(flights, chosen, floor, settings), []
    while found.hypothesis.chosen:
        out = nothing_by_size(found)
        if not out:
            refusal = on_bound(found) or may_be_another(found)
            if refusal is None:
                break
            refusals.append(refusal)
            out = [refusal.name]
        found = found.without(out)
        if refusals and refusals[-1].in_the_way:
            # The others are sought anew without it.
            break
    return found, refusals


def on_bound(found: NamedFit) -> Refusal | None:
    """Find an effect with a number of its size on a bound; where one is surely asked for beyond, that one is said."""
    chosen, effects = found.hypothesis.chosen, found.estimates.effects
    for (effect, _), numbers in zip(chosen, effects, strict=True):
        shapes = [shape.name for shape in effect.shapes]
        own = [number for number in numbers if number.name in shapes]
        at_ends = [any(bound and each.low <= bound <= each.high for bound in each.plausible) for each in own]
        # A shape that is its only number is its size; in the place of a curve others would follow the same error.
        if len(effect.numbers) > 1 and at_ends and all(at_ends):
            names = " and ".join(map(spoken, shapes))
            return Refusal(effect.name, f"{names} may be at the bounds of what is possible", len(shapes) > 1)
    for index, (effect, _) in enumerate(chosen):
        on_bounds = _on_bounds(sized(effect, effects[index]))
        bounds = {number.name: f"{bound:.3g} {number.unit}" for number, bound in on_bounds.items()}
        if not bounds:
            continue
        # What the flights ask for without any bounds.
        free = _without_bounds(found.hypothesis, channel_weight(found.hypothesis, found.floor), found.block)
        beyond = [number.name for number in free.effects[index] if number.name in bounds and number.impossible]
        says = "would surely be beyond" if beyond else "sits on the bound of"
        name = next(iter(beyond or bounds))
        return Refusal(effect.name, f"its {spoken(name)} {says} what is possible, {bounds[name]}", True)
    return None


def may_be_another(found: NamedFit) -> Refusal | None:
    """Find an effect of which nothing differs from 0 that another one, which it holds, has not: a wind of no speed."""
    for (effect, _), numbers in zip(found.hypothesis.chosen, found.estimates.effects, strict=True):
        for other in (CATALOGUE[name] for name in sorted(effect.holds)):
            theirs = {each.name for each in other.coefficients} | {each.name for each in other.shapes}
            more = [number for number in numbers if number.name not in theirs]
            if more and all(number.low <= 0.0 <= number.high for number in more):
                own = " and ".join(spoken(number.name) for number in more)
                return Refusal(effect.name, f"{own} may all be 0, where it is {other.title}", True)
    return None


def ends_on_bound(found: NamedFit) -> Refusal | None:
    """Find an effect, lags apart, that instruments have moved onto a bound of its size, or below 0 as a whole."""
    estimates = found.estimates
    for (effect, _), numbers, linear in zip(
        found.hypothesis.chosen, estimates.effects, estimates.of_effect, strict=True
    ):
        if linear.size and not linear.any():
            return Refusal(effect.name, "by instruments it would be below 0")
        for number, bound in () if effect.is_lag else _on_bounds(sized(effect, numbers)).items():
            most = f"{bound:.3g} {number.unit}"
            reason = f"by instruments its {spoken(number.name)} sits on the bound of what is possible, {most}"
            return Refusal(effect.name, reason)
    return None
