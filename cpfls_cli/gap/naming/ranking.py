"""Effects ranked beside a hypothesis, by what they explain of blocks that they have not seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.balance.balance_system import System, channel_size, floors, system
from cpfls_cli.gap.balance.refine import fit
from cpfls_cli.gap.balance.weak_flight import CHANNELS, Candidate, WeakFlight
from cpfls_cli.gap.naming.scoring import Scored, candidates_of, score, scoring_matrix
from cpfls_cli.gap.settings import CHANCE, COUNTS, NOISE, OFF, RARE, VISIBLE, GapSettings
from cpfls_cli.rounding import tied
from cpfls_cli.weak_form.resampling import blocks_of, folds, mirror_shifted


@dataclass(frozen=True)
class RankedStep:
    """All candidates ranked beside a hypothesis.

    Attributes
    ----------
    floor : array, shape (6,)
    ranking : tuple of Scored
        Best first, each effect once, at its best shape.
    chance : array, shape (shift,)
        What the best candidate explains of shifted residuals.
    above_floor : float
        Sum of squares that the hypothesis leaves above the floor, in squared floors.
    """

    hypothesis: System
    floor: Array
    ranking: tuple[Scored, ...]
    chance: Array
    above_floor: float

    def worth_a_name(self, explained: float = 0.0) -> float:
        """Compute what an effect has to explain of what a part explained leaves of the gap, in squared floors."""
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
    """Score all effects beside those chosen.

    Parameters
    ----------
    effects : sequence of Effect
        To be scored.
    rng : numpy.random.Generator or None
        Of the shifts; None for none.
    also : sequence of Candidate
        Tried beside the grids, with shapes of their own.
    floor : array, shape (6,), or None
        None: as the residual of the hypothesis shows it.
    """
    hypothesis = system(flights, chosen)
    floor = best_floor(hypothesis) if floor is None else floor
    names = {candidate.effect.name for candidate in chosen}
    listed = [*candidates_of([effect for effect in effects if effect.name not in names]), *also]
    tried = [candidate for candidate in listed if hypothesis.can(candidate)]
    arranged = scoring_matrix(hypothesis, tried, floor)
    right = hypothesis.residual[..., None]
    if rng is not None:
        unexplained = hypothesis.left(fit(hypothesis, floor))
        shifted = mirror_shifted(unexplained, hypothesis.flight_index, settings.shifts, rng)
        right = np.concatenate([right, shifted], axis=2)
    block = block_index(hypothesis, settings)
    beside = folds(arranged.matrix, right / floor[:, None], block, arranged.prior).beside(arranged.base)
    scored, chance = score(arranged, beside, hypothesis)
    above_floor = float(max(beside.before[:, 0].sum() - hypothesis.known.sum(), 1e-9))
    once: dict[str, Scored] = {}
    for each in scored:
        once.setdefault(each.candidate.effect.name, replace(each, others=hypothesis.chosen))
    return RankedStep(hypothesis, floor, tuple(once.values()), chance, above_floor)


def best_floor(hypothesis: System) -> Array:
    """Estimate the noise floors from the residual of a hypothesis.

    The fit and the floors depend on each other; starting from equal weights, a second round settles them.

    Returns
    -------
    array, shape (6,)
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


def surely(margin: Array) -> bool:
    """Tell whether margins over blocks are above 0 by more than they scatter: by ranks, as sizes differ that much."""
    return chance_of_ranks(margin) < CHANCE


def more_left(one: Array, other: Array) -> Array:
    """Compute by how much more one explanation leaves of each block than another; 0 where that is rounding."""
    return np.where(tied(one, other), 0.0, one - other)


def chance_of_ranks(margin: Array) -> float:
    """Compute how likely chance makes such margins over blocks, by the exact signed-rank test of Wilcoxon.

    Equal sizes share their ranks, and what is 0 has none.
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


def off_by(explained: float, left: float, above: float = 0.0) -> float:
    """Estimate how much formulas are off by at most, in squared floors.

    No formula is exact. Beside sensors and air it leaves noise of its own in proportion to its torque and force, the
    same in all flights. By likelihood that is what is left above the floor, and an error of the floor in one channel;
    before any flight it is known to be a tenth of torque and force at most, `OFF`.

    Parameters
    ----------
    explained : float
        The gap that formulas are asked to explain, in squared floors.
    left, above : float
        What the better one leaves, and what of that is above the floor, in squared floors.
    """
    return min(OFF**2 * explained, max(above, 0.0) + (NOISE - 1) * left / len(CHANNELS))


@cache
def _weights(blocks: int) -> Array:
    """Draw weights of blocks, so many that a rare probability is known as well as formulas are."""
    draws = round(1 / (RARE * OFF**2))
    return np.asarray(blocks * np.random.default_rng(0).dirichlet(np.ones(blocks), draws))


def log_odds(more: Array, off: float) -> Array:
    """Compute the logarithm of the predictive density of blocks under another set, less that under the first one.

    Parameters
    ----------
    more : array, shape (block,)
        By how much more the other one leaves, in squared floors.
    off : float
        What formulas are off by, in squared floors.
    """
    # A floor that is wrong scales what is left; only what is left above it is an error of formulas, one for all blocks.
    density = -0.5 * more / (NOISE + off)
    # In a rare block something else happens, which neither set knows: none says more than that.
    return np.asarray(np.clip(density, np.log(RARE), -np.log(RARE)))


def likely(odds: Sequence[Array]) -> Array:
    """Compute how likely a set of effects is beside others, from how well each foretells blocks that no fit saw.

    Sets differ in some blocks and not in others, and no formula is exact, so blocks are weighed at random.

    Parameters
    ----------
    odds : sequence of array, shape (block,)
        Logarithm of the predictive density of each block under another set, less that under the first one.

    Returns
    -------
    array, shape (1 + other,)
        Of the first one and of the others; they add up to 1.

    References
    ----------
    Yao, Vehtari, Simpson and Gelman 2018, Using stacking to average Bayesian predictive distributions (pseudo-BMA+).
    """
    blocks = len(odds[0]) if odds else 0
    if blocks < 2:
        # One block tells nothing of how far blocks differ.
        return np.full(len(odds) + 1, 1 / (len(odds) + 1))
    total = _weights(blocks) @ np.stack([np.zeros(blocks), *odds], axis=1)
    # One set a row: what is taken of many short rows is a tenth as fast. Eight and more are added in pairs.
    columns = np.ascontiguousarray(total.T)
    density = np.exp(columns - columns.max(axis=0))
    whole = density.sum(axis=0) if len(density) < 8 else np.ascontiguousarray(density.T).sum(axis=1)
    return np.asarray(np.add.accumulate(density / whole, axis=1)[:, -1] / len(total))
