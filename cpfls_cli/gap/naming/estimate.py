"""Coefficients with confidence intervals by the jackknife over blocks of time, and their sentence."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import half_width, jackknife_error
from cpfls_cli.effects.catalogue.parameter_error import NUMBERS
from cpfls_cli.effects.effect import Coefficient, Effect, Shape
from cpfls_cli.gap.balance.balance_system import System, system, window_noise
from cpfls_cli.gap.balance.refine import (
    Equations,
    equations,
    fit,
    fit_within_bounds,
    refitted,
    shape_columns,
)
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight
from cpfls_cli.gap.naming.ranking import block_index
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.gap.settings import CLEAR, GapSettings
from cpfls_cli.vehicle.settings import VehicleSettings

_KNOWN_TO = 0.005
"""Share of a number that no flight tells: mass and arms that it is measured against are hardly known better, and
formulas leave out terms as small."""


@dataclass(frozen=True)
class Estimates:
    """A fitted hypothesis.

    Attributes
    ----------
    linear : array, shape (column,)
        Of the base of the hypothesis.
    effects : tuple of tuple of Estimate
        Of each chosen effect: physical coefficients, then shapes.
    parameters : tuple of Estimate
        Of the vehicle's own numbers.
    of_effect : tuple of array, shape (coefficient,)
        Linear coefficients of each chosen effect; empty where it has none.
    """

    linear: Array
    effects: tuple[tuple[Estimate, ...], ...]
    parameters: tuple[Estimate, ...]
    of_effect: tuple[Array, ...]

    @property
    def of_vehicle(self) -> Array:
        """The vehicle's own numbers in `linear`."""
        return self.linear[: len(self.linear) - sum(len(linear) for linear in self.of_effect)]


class NamedFit(NamedTuple):
    """Effects fitted together to flights.

    Attributes
    ----------
    block : array of int, shape (window,)
    """

    hypothesis: System
    block: IntArray
    estimates: Estimates

    def without(self, names: Collection[str], floor: Array, settings: GapSettings) -> NamedFit:
        """Leave effects out and refit the others."""
        kept = [each for each in self.hypothesis.chosen if each.effect.name not in names]
        return fitted(self.hypothesis.flights, kept, floor, settings)


def estimates(hypothesis: System, weight: Array, block: IntArray) -> Estimates:
    """Fit a hypothesis and compute confidence intervals of its numbers by the jackknife.

    The jackknife leaves out one block after another, so it holds for residuals that are correlated within blocks and
    for noise of unequal size; what no flight tells is added (`_KNOWN_TO`). Shapes take part by their derivatives. The
    numbers of the vehicle are within what a vehicle can have; only where free ones are surely beyond it, they are told,
    because the log is wrong then.

    Parameters
    ----------
    hypothesis : System
        With refined shapes.
    weight : array, shape (6,) or (window, 6), N m and N
        Standard deviation of each channel.
    block : array of int, shape (window,)

    References
    ----------
    JCGM 100:2008, 4.3 (uncertainty of what is
    assumed).
    """
    free = _estimated(hypothesis, weight, block, *fit_within_bounds(hypothesis, weight))
    linear, held = fit_within_bounds(hypothesis, weight, of_vehicle=True)
    if np.array_equal(linear, free.linear):
        return free
    bounded = _estimated(hypothesis, weight, block, linear, held)
    wrong = any(number.impossible for number in free.parameters if number.name in NUMBERS)
    return replace(bounded, parameters=free.parameters) if wrong else bounded


def _estimated(hypothesis: System, weight: Array, block: IntArray, linear: Array, held: BoolArray) -> Estimates:
    """Add confidence intervals to a fit."""
    shapes = hypothesis.shape_values
    values = np.concatenate([linear, shapes])
    rotor_wrench = system(hypothesis.flights).rotor_wrench if len(shapes) else None
    moving_shapes = shape_columns(hypothesis, linear, rotor_wrench)
    moving = np.concatenate([~held, np.ones(len(shapes), dtype=bool)])
    left_out = np.tile(values, (len(np.unique(block)), 1))
    left_out[:, moving] += _one_step(
        equations(hypothesis, weight).around(linear, ~held, moving_shapes / weight[..., None]), block
    )
    return estimates_of(hypothesis, values, left_out)


def estimates_of(hypothesis: System, values: Array, left_out: Array) -> Estimates:
    """Tell numbers from coefficients and shapes, with those of fits that each left one block out.

    Parameters
    ----------
    values : array, shape (number,)
        Coefficients of the base, then shapes.
    left_out : array, shape (block, number)
    """
    linear = values[: hypothesis.base.shape[2]]
    (vehicle, own), *_ = hypothesis.places
    parameters = _of(vehicle, hypothesis, values[own], left_out[:, own], np.zeros(0), left_out[:, :0])
    places = {candidate.key: place for candidate, place in hypothesis.places}
    by_effect, linear_by_effect, first = [], [], len(linear)
    for candidate in hypothesis.chosen:
        place, shape_at = places.get(candidate.key, slice(0)), slice(first, first + len(candidate.effect.shapes))
        numbers = (values[place], left_out[:, place], values[shape_at], left_out[:, shape_at])
        by_effect.append(_of(candidate, hypothesis, *numbers))
        linear_by_effect.append(linear[place])
        first = shape_at.stop
    return Estimates(linear, tuple(by_effect), parameters, tuple(linear_by_effect))


def fitted(flights: Sequence[WeakFlight], chosen: Sequence[Candidate], floor: Array, settings: GapSettings) -> NamedFit:
    """Fit effects together within their bounds, with the larger of floor and residual as weights.

    Parameters
    ----------
    floor : array, shape (6,)

    Returns
    -------
    NamedFit
        With the shapes that fit best beside one another, where they fit to the noise.
    """
    start = system(flights, chosen)
    block, there = block_index(start, settings), refitted(start, channel_weight(start, floor))
    if (_left(there, floor)[1] > CLEAR).any():
        # Formulas that do not fit to the noise would move to what is left: they stay where the search found them.
        there = start
    return NamedFit(there, block, estimates(there, channel_weight(there, floor), block))


def free_estimates(hypothesis: System, floor: Array, block: IntArray) -> Estimates:
    """Fit alike without any bounds, which says what the flights ask for.

    Parameters
    ----------
    floor : array, shape (6,)
    block : array of int, shape (window,)
    """
    weight = channel_weight(hypothesis, floor)
    linear = equations(hypothesis, weight).solve()
    return _estimated(hypothesis, weight, block, linear, np.zeros(len(linear), dtype=bool))


def channel_weight(hypothesis: System, floor: Array) -> Array:
    """Take the larger of noise and residual of each channel, shape (window, 6).

    Noise is the floor with what the chosen effects do at random.
    """
    noise, left = _left(hypothesis, floor)
    return np.asarray(noise * np.maximum(1.0, left))


def _left(hypothesis: System, floor: Array) -> tuple[Array, Array]:
    """Estimate the noise of each window, shape (window, 6), and the root mean square that a fit leaves in it, (6,)."""
    residual = hypothesis.left(fit(hypothesis, floor))
    noise = window_noise(hypothesis, residual, floor)
    if (noise > floor).any():
        residual = hypothesis.left(fit(hypothesis, noise))
    return noise, np.sqrt(np.mean((residual / noise) ** 2, axis=0))


def sized(effect: Effect, numbers: Sequence[Estimate]) -> list[Estimate]:
    """Keep the numbers that set the size of an effect: its coefficients, or its shapes where it has none.

    Parameters
    ----------
    numbers : sequence of Estimate
        Physical coefficients, then shapes.
    """
    shapes = {shape.name for shape in effect.shapes}
    return [number for number in numbers if (number.name in shapes) == effect.unit_coefficient]


def _of(
    candidate: Candidate, hypothesis: System, linear: Array, linear_out: Array, shape: Array, shape_out: Array
) -> tuple[Estimate, ...]:
    """Tell the numbers of an effect with 95 % confidence intervals: by the jackknife, and what no flight tells."""
    effect = candidate.effect
    if effect.physical and len(linear):
        linear, linear_out = effect.physical.of(linear), np.array([effect.physical.of(row) for row in linear_out])
    known: tuple[Coefficient | Shape, ...] = (*effect.coefficients[: len(linear)], *effect.shapes)
    value, left_out = np.concatenate([linear, shape]), np.concatenate([linear_out, shape_out], axis=1)
    half = np.full(len(value), np.inf)
    if len(left_out) > 1:
        half = np.hypot(half_width(jackknife_error(left_out), len(left_out)), _KNOWN_TO * value)
    return tuple(
        Estimate(one.name, one.unit, float(v), float(v - h), float(v + h), one.bounds(hypothesis.vehicle))
        for one, v, h in zip(known, value, half, strict=True)
        # A column of zeros leaves its coefficient open: an offset along x, say, where only x is compared.
        if one in effect.shapes or (np.isfinite(v) and (v != 0 or h != 0 or effect.kind == "parameter"))
    )


def _one_step(rows: Equations, block: IntArray) -> Array:
    """Compute the change of all numbers without each block by one Gauss-Newton step, shape (block, number)."""
    scale = np.linalg.norm(rows.columns, axis=0)
    scaled, noise = (part / np.where(scale > 0, scale, 1.0) for part in (rows.columns, rows.noise[:, :-1]))
    of_row = np.repeat(block, len(rows.right) // len(block))
    parts = [
        (scaled[own].T, noise[own].T, rows.right[own], rows.noise[own, -1])
        for own in (of_row == b for b in np.unique(block))
    ]
    gram = np.array([x @ x.T - rows.trusted * (n @ n.T) for x, n, _, _ in parts])
    moment = np.array([x @ right - rows.trusted * (n @ own) for x, n, right, own in parts])
    ridge = 1e-9 * np.eye(gram.shape[1])
    change = -np.linalg.solve(gram.sum(axis=0) - gram + ridge, moment[..., None])[..., 0]
    return np.asarray(change / np.where(scale > 0, scale, 1.0))


def effect_sentence(effect: Effect, numbers: Sequence[Estimate], vehicle: VehicleSettings) -> str:
    """Compose the sentence on an effect and its significant numbers.

    Parameters
    ----------
    numbers : sequence of Estimate
        Coefficients, then shapes.

    Returns
    -------
    str
        The sentence of the catalogue, and what the numbers that are surely not zero add to it.
    """
    sure = {number.name: number.value for number in numbers if number.low > 0 or number.high < 0}
    more = "" if effect.describe is None else effect.describe(vehicle, sure)
    return f"{effect.sentence} {more}".rstrip()


def nothing_by_size(found: NamedFit) -> list[str]:
    """Name the effects whose size does not differ from zero."""
    names = []
    for (effect, _), numbers in zip(found.hypothesis.chosen, found.estimates.effects, strict=True):
        without_size = effect.unit_coefficient and not effect.shapes
        if not (without_size or any(number.low > 0 or number.high < 0 for number in sized(effect, numbers))):
            names.append(effect.name)
    return names
