"""Sets of effects compared by their residual in blocks that no fit saw: which are beaten, and how likely each is."""

from collections.abc import Sequence
from functools import cache

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.gap.balance.weak_flight import CHANNELS, Candidate
from cpfls_cli.gap.naming.ranking import Scored
from cpfls_cli.gap.settings import NOISE, OFF, RARE
from cpfls_cli.rounding import tied


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
