"""Cross-validated gain of each candidate within physical bounds, and the gain of chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.balance.balance_system import System
from cpfls_cli.gap.balance.refine import compensation, fit, shape_columns
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.settings import ERRORS
from cpfls_cli.rounding import ascending
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.resampling import Beside


@dataclass(frozen=True)
class Scored:
    """A candidate with its cross-validated gain.

    Attributes
    ----------
    gain : float
        Sum of squares taken off the blocks that the fits did not see, in squared floors; minus infinity where refused.
    block_error : array, shape (block,)
        What is left on each block.
    coefficients : array, shape (coefficient,)
        Linear, of a fit on all blocks; 0 where a bound took one out.
    others : tuple of Candidate
        What it stands beside.
    """

    candidate: Candidate
    gain: float
    block_error: Array
    coefficients: Array
    others: tuple[Candidate, ...] = ()

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """The whole set."""
        return (*self.others, self.candidate)


@dataclass(frozen=True)
class ScoringMatrix:
    """Base columns and candidates side by side.

    Attributes
    ----------
    matrix : array, shape (window, 6, column)
        Weighted.
    candidates : tuple of (Candidate, array of int, array)
        Each with its columns of the matrix, and a weight on the residual of each channel, shape (6,).
    prior : array, shape (column,)
        What bounds say of the coefficients before any data.
    """

    matrix: Array
    base: IntArray
    candidates: tuple[tuple[Candidate, IntArray, Array], ...]
    prior: Array


def candidates_of(effects: Sequence[Effect]) -> list[Candidate]:
    """List effects at all points of their grids."""
    return [
        Candidate(effect, dict(zip((shape.name for shape in effect.shapes), values, strict=True)))
        for effect in effects
        for values in product(*(shape.tried for shape in effect.shapes))
    ]


def scoring_matrix(hypothesis: System, candidates: Sequence[Candidate], floor: Array) -> ScoringMatrix:
    """Arrange base and candidates, in floors.

    The shapes of the chosen effects stand in the base by their derivatives, so that a candidate is judged by what it
    adds after they have moved.

    Parameters
    ----------
    floor : array, shape (6,)
    """
    moving = shape_columns(hypothesis, fit(hypothesis, floor))
    parts: list[Array] = [hypothesis.base, moving]
    placed: list[tuple[Candidate, IntArray, Array]] = []
    first = hypothesis.base.shape[2] + moving.shape[2]
    base = np.arange(first)
    for candidate in candidates:
        columns = hypothesis.columns(candidate)
        parts.append(columns)
        indices = np.arange(first, first + columns.shape[2])
        weight = np.ones(6)
        if candidate.effect.kind == "actuator":
            weight = compensation(hypothesis.rotor_wrench, hypothesis.rotor_wrench + columns[..., 0])
        placed.append((candidate, indices, weight))
        first += columns.shape[2]
    offered = [information(candidate.effect, len(own), hypothesis.vehicle) for candidate, own, _ in placed]
    prior = np.concatenate([known_before(hypothesis), *offered])
    return ScoringMatrix(np.concatenate(parts, axis=2) / floor[:, None], base, tuple(placed), prior)


def score(arranged: ScoringMatrix, beside: Beside, hypothesis: System) -> tuple[list[Scored], Array]:
    """Score every candidate, and the best of them on what is chance.

    Signs and bounds are not used on chance, so that it is given more than its due.

    Parameters
    ----------
    beside : Beside
        Of the residual, and of shifted residuals behind it.

    Returns
    -------
    list of Scored
        Best first.
    chance : array, shape (shift,)
        Gain of the best candidate on each of the shifted residuals.
    """
    scored = []
    chance = np.full(beside.before.shape[1] - 1, -np.inf)
    for candidate, columns, weight in arranged.candidates:
        error = _error(candidate, columns, weight, beside)
        chance = np.maximum(chance, (beside.before - error)[:, 1:].sum(axis=0))
        scored.append(_scored(candidate, columns, weight, error[:, 0], beside, hypothesis.vehicle))
    return ascending(scored, lambda candidate: -candidate.gain), chance


def _error(candidate: Candidate, columns: IntArray, weight: Array, beside: Beside) -> Array:
    """Compute what a candidate leaves of each block; a block that alone shows it does not count against it."""
    if candidate.effect.unit_coefficient:
        return beside.subtracted(int(columns[0]), weight)
    error = beside.unseen(columns)
    return np.where(beside.normal.alone(columns)[:, None], np.minimum(beside.before, error), error)


def _scored(
    candidate: Candidate, columns: IntArray, weight: Array, error: Array, beside: Beside, vehicle: VehicleSettings
) -> Scored:
    """Score a candidate that leaves `error` of the blocks with all its columns."""
    before = beside.before[:, 0]
    if candidate.effect.unit_coefficient:
        return Scored(candidate, float((before - error).sum()), error, np.ones(1))
    kept = np.ones(len(columns), dtype=bool)
    for _ in range(len(columns)):
        fitted, unsure = np.zeros(len(columns)), np.zeros(len(columns))
        fitted[kept], unsure[kept] = beside.fit(columns[kept])
        keep, admissible = within_bounds(candidate.effect, fitted, unsure, vehicle)
        if not admissible or not (kept & keep).any():
            return Scored(candidate, -np.inf, before, fitted)
        if (kept & keep == kept).all():
            break
        kept &= keep
    if not kept.all():
        error = _error(candidate, columns[kept], weight, beside)[:, 0]
    return Scored(candidate, float((before - error).sum()), error, fitted)


def within_bounds(effect: Effect, linear: Array, error: Array, vehicle: VehicleSettings) -> tuple[BoolArray, bool]:
    """Check coefficients against the bounds of their effect.

    A coefficient counts as beyond a bound only by more than its uncertainty.

    Parameters
    ----------
    linear : array, shape (coefficient,)
        Linear coefficients of a fit.
    error : array, shape (coefficient,)
        Their standard errors.

    Returns
    -------
    keep : array of bool, shape (coefficient,)
        False where a coefficient lies beyond a bound at 0, so that 0 is the best that is possible.
    admissible : bool
        False where one lies beyond another bound.
    """
    keep = np.ones(len(linear), dtype=bool)
    listed = effect.coefficients
    if effect.physical is not None:
        ends = np.array([effect.physical.of(linear + way * ERRORS * error) for way in (-1, 1)])
        physical = effect.physical.of(linear)
        low, high = np.array([each.bounds(vehicle) for each in listed])[: len(physical)].T
        unsure = np.isnan(ends).any(axis=0) | np.isnan(physical)
        return keep, bool(np.all(unsure | ((ends.max(axis=0) >= low) & (ends.min(axis=0) <= high))))
    low, high = np.array([each.bounds(vehicle) for each in listed]).T
    at_zero = ((linear < low) & (low == 0)) | ((linear > high) & (high == 0))
    beyond = (linear + ERRORS * error < low) | (linear - ERRORS * error > high)
    # What is taken out changes the others first: a lever is judged in the round after.
    if effect.lever is not None and len(linear) == len(effect.coefficients) and not at_zero.any():
        at_zero |= ~effect.lever(np.where(at_zero, 0.0, linear), error, vehicle)
    return ~at_zero, bool(not np.any(beyond & ~at_zero))


def known_before(hypothesis: System) -> Array:
    """Compute the prior information of the coefficients of a base and of the shapes behind them, shape (number,)."""
    vehicle, places = hypothesis.vehicle, hypothesis.places
    free = [information(candidate.effect, place.stop - place.start, vehicle) for candidate, place in places]
    return np.concatenate([*free, [1.0 / np.ptp(shape.grid) ** 2 for shape in hypothesis.shapes]])


def information(effect: Effect, columns: int, vehicle: VehicleSettings) -> Array:
    """Compute the prior information of linear coefficients from their bounds.

    A coefficient that only one block of a flight determines would be anything where that block is left out; with its
    bound as the standard deviation of a normal prior it is small there.

    Parameters
    ----------
    columns : int
        Linear coefficients in use.

    Returns
    -------
    array, shape (coefficient,)
        One over the variance; 0 where the physical coefficients are not linear.
    """
    listed = effect.coefficients
    if effect.physical is not None or len(listed) != columns:
        return np.zeros(columns)
    return np.array([1.0 / max(abs(bound) for bound in each.bounds(vehicle)) ** 2 for each in listed])
