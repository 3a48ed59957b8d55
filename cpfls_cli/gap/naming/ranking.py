"""Effects ranked given a hypothesis, within physical bounds, by blocks that no fit saw; and how likely sets are.

Floors are of shape (6,), N m and N, by channel.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.registry import THRUST_CURVE
from cpfls_cli.gap.balance.balance_system import System, channel_size, floors, system
from cpfls_cli.gap.balance.refine import fit, number_columns, torque_loss_ratio
from cpfls_cli.gap.balance.weak_flight import CHANNELS, Candidate, WeakFlight
from cpfls_cli.gap.settings import COUNTS, ERRORS, NOISE, OFF, RARE, VISIBLE, GapSettings
from cpfls_cli.rounding import ascending, tied
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import ConditionalNormalEquations, blocks_of, folds, mirror_shifted


@dataclass(frozen=True)
class Scored:
    """A candidate, the last of its set, with its cross-validated gain."""

    chosen: tuple[Candidate, ...]  # The hypothesis, and itself.
    # Sum of squares taken off the blocks that the fits did not see, in squared floors; minus infinity where refused.
    gain: float
    block_error: Array  # Shape (block,): sum of squares of the residual.
    coefficients: Array  # Shape (coefficient,): linear, of a fit on all blocks; 0 where a bound took one out.

    @property
    def candidate(self) -> Candidate:
        """The last of the set."""
        return self.chosen[-1]


@dataclass(frozen=True)
class RankedStep:
    """All candidates ranked given a hypothesis."""

    hypothesis: System
    floor: Array
    ranking: tuple[Scored, ...]  # Best first, each effect once, at its best shape.
    chance: Array  # Shape (shift,): what the best candidate explains of shifted residuals.
    above_floor: float  # Residual sum of squares above the floor, in squared floors.
    block: IntArray  # Shape (window,): of the cross-validation.

    def least_gain(self, explained: float = 0.0) -> float:
        """Compute what an effect has to explain of a gap, of which a part is explained, in squared floors."""
        gap = max(self.above_floor - explained, 0.0)
        return max(COUNTS * gap, VISIBLE**2 * len(self.hypothesis.residual))

    def p_value(self, gain: float) -> float:
        """Compute the probability that chance explains as much, over the whole catalogue.

        The share of shifts that do; beyond all of them, the tail of the extreme-value law fitted to them.
        """
        if not np.isfinite(gain):
            return 1.0
        reached = (1 + int((self.chance >= gain).sum())) / (1 + len(self.chance))
        if reached > 1.5 / (1 + len(self.chance)):
            return reached
        # By moments: a fit by likelihood is several times slower and no better in the tail.
        scale = max(float(np.std(self.chance)) * np.sqrt(6) / np.pi, 1e-12)
        mode = np.mean(self.chance) - np.euler_gamma * scale
        return float(min(reached, -np.expm1(-np.exp(-(gain - mode) / scale))))


def rank_effects(
    flights: Sequence[WeakFlight],
    chosen: Sequence[Candidate],
    effects: Sequence[Effect],
    settings: GapSettings,
    rng: np.random.Generator | None,
    also: Sequence[Candidate] = (),
    floor: Array | None = None,
) -> RankedStep:
    """Score all effects given those chosen.

    `rng`: of the shifts; None for none.
    `also`: tried with the grids, with shapes of their own.
    `floor`, shape (6,): None: as the residual of the hypothesis shows it.
    """
    hypothesis = system(flights, chosen)
    floor = best_floor(hypothesis) if floor is None else floor
    names = {candidate.effect.name for candidate in chosen}
    listed = [*candidates_of([effect for effect in effects if effect.name not in names]), *also]
    arranged = scoring_matrix(hypothesis, [each for each in listed if hypothesis.can(each)], floor)
    right = hypothesis.residual[..., None]
    if rng is not None:
        unexplained = hypothesis.residual_at(fit(hypothesis, floor))
        shifted = mirror_shifted(unexplained, hypothesis.flight_index, settings.shifts, rng)
        right = np.concatenate([right, shifted], axis=2)
    block = block_index(hypothesis, settings)
    conditional = folds(arranged.matrix, right / floor[:, None], block, arranged.prior).conditional_on(arranged.base)
    scored, chance = score(arranged, conditional, hypothesis)
    above_floor = float(max(conditional.before[:, 0].sum() - hypothesis.known.sum(), 1e-9))
    once: dict[str, Scored] = {}
    for each in scored:
        once.setdefault(each.candidate.effect.name, each)
    return RankedStep(hypothesis, floor, tuple(once.values()), chance, above_floor, block)


def best_floor(hypothesis: System) -> Array:
    """Estimate the noise floors from the residual of a hypothesis, shape (6,).

    The fit and the floors depend on each other; starting from equal weights, a second round settles them.
    """

    def settled() -> Array:
        floor = channel_size(hypothesis.residual)
        for _ in range(2):
            floor = floors(hypothesis, fit(hypothesis, floor))
        return floor

    key = (best_floor, hypothesis.flights, tuple(candidate.key for candidate in hypothesis.chosen))
    return hypothesis.flights[0].signals.once(key, settled)


def block_index(hypothesis: System, settings: GapSettings) -> IntArray:
    """Assign each window to a block of the cross-validation, shape (window,)."""
    centres = np.concatenate([f.windows.centres(f.signals.time) for f in hypothesis.flights])
    return blocks_of(hypothesis.flight_index, centres, settings.block_s)


def candidates_of(effects: Sequence[Effect]) -> list[Candidate]:
    """List effects at all points of their grids."""
    return [
        Candidate(effect, dict(zip((shape.name for shape in effect.shapes), values, strict=True)))
        for effect in effects
        for values in product(*(shape.tried for shape in effect.shapes))
    ]


class ScoringMatrix(NamedTuple):
    """Base columns and candidates side by side."""

    matrix: Array  # Shape (window, 6, column), floors.
    base: IntArray  # Columns of the base, and behind them derivatives by the shapes of its effects.
    # Each with its columns of the matrix, and a weight on the residual of each channel, shape (6,).
    candidates: list[tuple[Candidate, IntArray, Array]]
    prior: Array  # Shape (column,): what bounds say of the coefficients before any data.


def scoring_matrix(hypothesis: System, candidates: Sequence[Candidate], floor: Array) -> ScoringMatrix:
    """Arrange base and candidates, in floors.

    The shapes of the chosen effects are in the base by their derivatives, so that a candidate is judged by what it
    adds after they have moved.
    """
    base, linear = hypothesis.base, fit(hypothesis, floor)
    parts = [base, number_columns(hypothesis, linear)[..., base.shape[2] :]]
    priors, placed = [known_before(hypothesis)], list[tuple[Candidate, IntArray, Array]]()
    # A curve of the thrust is a part of what turns the vehicle; torques of one axis alone shrink with its inertia.
    curves = (base[..., own] @ linear[own] for each, own in hypothesis.places if each.effect.name == THRUST_CURVE.name)
    own_wrench = sum(curves, hypothesis.rotor_wrench)
    places = np.arange(base.shape[2] + parts[1].shape[2])
    first = len(places)
    for candidate in candidates:
        columns = hypothesis.columns(candidate)
        actuator = candidate.effect.kind == "actuator"
        weight = torque_loss_ratio(own_wrench, own_wrench + columns[..., 0]) if actuator else np.ones(6)
        placed.append((candidate, np.arange(first, first := first + columns.shape[2]), weight))
        parts.append(columns)
        priors.append(_information(candidate.effect, columns.shape[2], hypothesis.vehicle))
    return ScoringMatrix(np.concatenate(parts, axis=2) / floor[:, None], places, placed, np.concatenate(priors))


def score(
    arranged: ScoringMatrix, conditional: ConditionalNormalEquations, hypothesis: System
) -> tuple[list[Scored], Array]:
    """Score every candidate, best first, and the best of them on what is chance, shape (shift,).

    Chance is what follows the residual: the same, shifted. Signs and bounds are not used on it, so that chance is
    given more than its due.
    """
    scored = []
    chance = np.full(conditional.before.shape[1] - 1, -np.inf)
    for candidate, columns, weight in arranged.candidates:
        error = _error(candidate, columns, weight, conditional)
        chance = np.maximum(chance, (conditional.before - error)[:, 1:].sum(axis=0))
        scored.append(_scored(hypothesis, candidate, columns, weight, error[:, 0], conditional))
    return ascending(scored, lambda candidate: -candidate.gain), chance


def _error(candidate: Candidate, columns: IntArray, weight: Array, conditional: ConditionalNormalEquations) -> Array:
    """Compute the residual of each block with a candidate, shape (block, draw)."""
    if candidate.effect.unit_coefficient:
        return conditional.subtracted(int(columns[0]), weight)
    return conditional.unseen(columns)


def _scored(
    hypothesis: System,
    candidate: Candidate,
    columns: IntArray,
    weight: Array,
    error: Array,
    conditional: ConditionalNormalEquations,
) -> Scored:
    """Score a candidate whose residual of the blocks is `error` with all its columns."""
    chosen, before = (*hypothesis.chosen, candidate), conditional.before[:, 0]
    fitted, kept = np.ones(len(columns)), np.ones(len(columns), dtype=bool)
    while not candidate.effect.unit_coefficient:
        fitted, unsure = np.zeros(len(columns)), np.zeros(len(columns))
        fitted[kept], unsure[kept] = conditional.fit(columns[kept])
        keep, admissible = within_bounds(candidate.effect, fitted, unsure, hypothesis.vehicle)
        if not admissible or not (kept & keep).any():
            return Scored(chosen, -np.inf, before, fitted)
        if keep[kept].all():
            break
        kept &= keep
    if not kept.all():
        error = _error(candidate, columns[kept], weight, conditional)[:, 0]
    return Scored(chosen, float((before - error).sum()), error, fitted)


def within_bounds(effect: Effect, linear: Array, error: Array, vehicle: VehicleSettings) -> tuple[BoolArray, bool]:
    """Check coefficients against the bounds of their effect: they are beyond one only by more than their uncertainty.

    `linear`, `error`, shape (coefficient,): linear coefficients of a fit, and their standard errors.
    Result `keep`, shape (coefficient,): false where a coefficient lies beyond a bound at 0, so that 0 is the best that
    is possible.
    Result `admissible`: false where one lies beyond another bound.
    """
    low, high = np.array([each.bounds(vehicle) for each in effect.coefficients]).T
    if effect.physical is not None:
        ends = np.array([effect.physical.of(linear + way * ERRORS * error) for way in (-1, 1)])
        physical = effect.physical.of(linear)
        low, high = low[: len(physical)], high[: len(physical)]
        unsure = np.isnan(ends).any(axis=0) | np.isnan(physical)
        possible = unsure | ((ends.max(axis=0) >= low) & (ends.min(axis=0) <= high))
        return np.ones(len(linear), dtype=bool), bool(possible.all())
    at_zero = ((linear < low) & (low == 0)) | ((linear > high) & (high == 0))
    beyond = (linear + ERRORS * error < low) | (linear - ERRORS * error > high)
    # What is taken out changes the others first: a lever is judged in the round after.
    if effect.lever is not None and not at_zero.any():
        at_zero = ~effect.lever(linear, error, vehicle)
    return ~at_zero, not (beyond & ~at_zero).any()


def known_before(hypothesis: System) -> Array:
    """Compute the prior information of the coefficients of a base and of the shapes behind them, shape (number,).

    A coefficient that only one block of a flight determines would be anything where that block is left out; with its
    bound as the standard deviation of a normal prior it is small there.
    """
    vehicle, places = hypothesis.vehicle, hypothesis.places
    free = [_information(each.effect, place.stop - place.start, vehicle) for each, place in places]
    return np.concatenate([*free, [1.0 / np.ptp(shape.grid) ** 2 for shape in hypothesis.shapes]])


def _information(effect: Effect, columns: int, vehicle: VehicleSettings) -> Array:
    """Compute one over the variance of linear coefficients by their bounds; 0 where these bound other numbers."""
    listed = effect.coefficients
    if effect.physical is not None or len(listed) != columns:
        return np.zeros(columns)
    return np.array([1.0 / max(abs(bound) for bound in each.bounds(vehicle)) ** 2 for each in listed])


def names_of(chosen: Sequence[Candidate]) -> frozenset[str]:
    """Name the effects of a set."""
    return frozenset(each.effect.name for each in chosen)


def free_numbers(chosen: Sequence[Candidate]) -> int:
    """Count the numbers that a set is free to choose."""
    return sum(len(each.effect.shapes) + len(each.effect.coefficients) for each in chosen)


def more_residual(one: Array, other: Array) -> Array:
    """Compute by how much one residual of each block exceeds another; 0 where that is rounding."""
    return np.where(tied(one, other), 0.0, one - other)


def chance_of_ranks(margin: Array) -> float:
    """Compute how likely chance makes such margins over blocks, by the exact signed-rank test of Wilcoxon.

    Equal sizes share their ranks, for which `scipy.stats.wilcoxon` has no exact test, and what is 0 has none.
    """
    differing = margin[margin != 0]
    sizes = np.sort(np.abs(differing))
    ranks = np.searchsorted(sizes, np.abs(differing)) + np.searchsorted(sizes, np.abs(differing), side="right") + 1
    # How likely each smaller sum of the ranks of margins above 0 is where every sign is a throw of a coin.
    smaller = np.zeros(ranks[differing > 0].sum())
    smaller[:1] = 1.0
    for rank in ranks:
        smaller[rank:] += smaller[:-rank]
        smaller /= 2
    return float(1.0 - smaller.sum())


def off_by(explained: float, left: float, above: float) -> float:
    """Estimate how much formulas are off by at most, in squared floors.

    No formula is exact. To sensors and air it adds noise of its own in proportion to its torque and force, the
    same in all flights. By likelihood that is the residual above the floor, and an error of the floor in one channel;
    before any flight it is known to be a tenth of torque and force at most, `OFF`.

    `explained`: the gap that formulas are asked to explain, in squared floors.
    `left`, `above`: residual of the better one, and what of it is above the floor, in squared floors.
    """
    return min(OFF**2 * explained, max(above, 0.0) + (NOISE - 1) * left / len(CHANNELS))


def log_odds(more: Array, off: float) -> Array:
    """Compute the logarithm of the predictive density of blocks under another set, less that under the first one.

    `more`, shape (block,): by how much the residual of the other one is larger, in squared floors.
    `off`: what formulas are off by, in squared floors.
    """
    # A floor that is wrong scales the residual; only what is above it is an error of formulas, one for all blocks.
    density = -0.5 * more / (NOISE + off)
    # In a rare block something else happens, which neither set knows: none says more than that.
    return np.asarray(np.clip(density, np.log(RARE), -np.log(RARE)))


def odds(own: Scored, other: Scored, above_floor: float) -> Array:
    """Compute the `log_odds` of another set, shape (block,), where the residual of no set at all is `above_floor`."""
    off = off_by(above_floor, 0.0, above_floor - own.gain)
    return log_odds(more_residual(other.block_error, own.block_error), off)


@cache
def _weights(blocks: int) -> Array:
    """Draw weights of blocks, so many that a rare probability is known as well as formulas are."""
    draws = round(1 / (RARE * OFF**2))
    return np.asarray(blocks * np.random.default_rng(0).dirichlet(np.ones(blocks), draws))


def likely(odds: Sequence[Array]) -> Array:
    """Compute how likely a set of effects is against others, from how well each predicts blocks that no fit saw.

    Sets differ in some blocks and not in others, and no formula is exact, so blocks are weighed at random.

    `odds`, each shape (block,): logarithm of the predictive density of each block under another set, less that under
    the first one.
    Result: shape (1 + other,); of the first one and of the others; they add up to 1.
    Reference: Yao, Vehtari, Simpson and Gelman 2018, Using stacking to average Bayesian predictive distributions
    (pseudo-BMA+).
    """
    blocks = len(odds[0]) if odds else 0
    if blocks < 2:
        # One block does not show how far blocks differ.
        return np.full(len(odds) + 1, 1 / (len(odds) + 1))
    # One set a row: sums of many short rows are a tenth as fast.
    total = np.stack([np.zeros(blocks), *odds]) @ _weights(blocks).T
    density = np.exp(total - total.max(axis=0))
    return np.asarray((density / density.sum(axis=0)).mean(axis=1))


def unbeaten(chosen: Scored, ranking: Sequence[Scored], above_floor: float) -> list[Scored]:
    """List the candidates that the chosen one does not beat: those that are not rare against it."""
    known = names_of(chosen.chosen)
    others = [each for each in ranking if np.isfinite(each.gain) and names_of(each.chosen) != known]
    own, *weights = likely([odds(chosen, other, above_floor) for other in others])
    return [each for each, weight in zip(others, weights, strict=True) if weight >= RARE * own]


def simplest(ranking: Sequence[Scored], above_floor: float, number: float) -> Scored:
    """Choose among the best candidates the one with the fewest free numbers.

    `ranking`: best first.
    `number`: what a free number has to explain, in squared floors: the logarithm of the number of residuals (Schwarz
    1978).
    """
    best = ranking[0]
    off = off_by(above_floor, float(best.block_error.sum()), above_floor - best.gain)
    alike = [best]
    for other in unbeaten(best, ranking, above_floor):
        fewer = free_numbers(best.chosen) - free_numbers(other.chosen)
        if best.gain - other.gain < max(off, number * fewer):
            alike.append(other)
    fewest = min(free_numbers(each.chosen) for each in alike)
    few = [each for each in alike if free_numbers(each.chosen) == fewest]
    most = max(each.gain for each in few)
    # What no number separates is decided by what is usual: rotors always lag.
    usual = [each for each in few if most - each.gain < number]
    return min(usual, key=lambda scored: sorted(each.effect.order for each in scored.chosen))
