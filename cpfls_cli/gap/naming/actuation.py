"""Effects between command and rotors, where each can stand for another: compared once all their shapes have moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.balance.balance_system import System, system
from cpfls_cli.gap.balance.refine import compensation, refined, weighted_residual
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight
from cpfls_cli.gap.naming.ranking import (
    NEAR,
    RankedStep,
    best_floor,
    block_index,
    chance_of_ranks,
    least_gain,
    more_left,
    rows,
    surely_less,
)
from cpfls_cli.gap.naming.scoring import (
    Scored,
    normal_equations,
    scoring_matrix,
)
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.rounding import ascending, largest


def late(chosen: Sequence[Candidate]) -> list[Candidate]:
    """List the effects between command and rotors: two of them, with other shapes, can do what a third does."""
    return [candidate for candidate in chosen if candidate.effect.actuation is not None]


def beside_its_like(chosen: Sequence[Candidate], index: int) -> bool:
    """Tell whether an effect and another one lie between command and rotors, where each can stand for the other."""
    return chosen[index].effect.actuation is not None and len(late(chosen)) > 1


def moved(flights: Sequence[WeakFlight], chosen: Sequence[Candidate], step: RankedStep) -> Sequence[Scored]:
    """Score anew, with all shapes moved, what lies between command and rotors and comes near the best, if that does.

    Between the points of a grid an effect with more shapes comes closer to what one with fewer is. The candidates stay
    where they are: what is chosen is refined together with all others.
    """
    best = step.ranking[0]
    near = [s for s in step.ranking if late([s.candidate]) and s.gain > NEAR * best.gain]
    if best not in near or len(near) < 2:
        return step.ranking
    there = [(_rescored(refined(flights, [*chosen, s.candidate], step.floor), step), s.candidate) for s in near]
    return ascending((replace(scored, candidate=own) for scored, own in there), lambda scored: -scored.gain)


def parted(refitted: System, step: RankedStep) -> System:
    """Take two effects for a last one with two shapes, where they leave less, or enough less with a number more."""
    others, last = refitted.chosen[:-1], len(refitted.chosen) - 1
    if not _stands_for_two(refitted.chosen, last):
        return refitted
    pairs = _pairs(refitted.flights, others, step)
    best = largest([refitted, *pairs], lambda each: _rescored(each, step).gain)
    for wider in _wider_pairs(refitted.flights, others, refitted.chosen[last], step):
        more, less = _rescored(wider, step), _rescored(best, step)
        if more.gain - less.gain >= _enough(step, less) and surely_less(more, less):
            best = wider
    return best


def without_companion(refitted: System, step: RankedStep, settings: GapSettings) -> System:
    """Take two effects for one with two shapes, where beside them what was added last is not needed.

    What one filter leaves of another one and a lag is small, and follows the motion as much as the effects do that
    would fill it.

    Parameters
    ----------
    refitted : System
        With what was added.
    step : SearchStep
        The look that added it.
    """
    *before, newest = refitted.chosen
    for index, candidate in enumerate(before):
        if newest.effect.actuation is not None or not _stands_for_two(before, index):
            continue
        others = [other for other in before if other is not candidate]
        one = _rescored(system(refitted.flights, before), step)
        for pair in _wider_pairs(refitted.flights, others, candidate, step):
            together = refined(refitted.flights, [*pair.chosen, newest], step.floor)
            # It has more numbers than the pair, so blocks that no fit saw decide.
            gained = (_unseen(pair, step.floor, settings) - _unseen(together, step.floor, settings)).sum()
            if surely_less(_rescored(pair, step), one) and gained < _enough(step, one):
                return pair
    return refitted


def settled(flights: Sequence[WeakFlight], chosen: Sequence[Candidate], index: int, step: RankedStep) -> list[Scored]:
    """Score an effect between command and rotors and its like beside another one, once all shapes have moved.

    Points of a grid would not do: where a lag stands for a delay, the width of a notch moves with it.

    Parameters
    ----------
    index : int
        Of the effect among them.
    step : SearchStep
        The look at the others without it.

    Returns
    -------
    list of Scored
        The effect, then its like, then all else as ranked; the ranking where nothing has to move.
    """
    others = [other for place, other in enumerate(chosen) if place != index]
    ranked = sorted(step.ranking, key=lambda scored: scored.candidate.effect.name != chosen[index].effect.name)
    if _stands_for_two(chosen, index):
        pairs = _pairs(flights, others, step)
        own = _rescored(system(flights, [*others, chosen[index]]), step)
        wider = _wider_pairs(flights, others, chosen[index], step)
        less = [pair for pair in wider if surely_less(_rescored(pair, step), own)]
        # The last two effects of a pair together can do what one does.
        as_one = (replace(_rescored(pair, step), beside=pair.chosen[-2].effect) for pair in (*pairs, *less))
        return [own, *as_one, *ranked[1:]]
    if not beside_its_like(chosen, index):
        return ranked
    names = {each.effect.name for each in chosen}
    return [
        _rescored(system(flights, [*others, chosen[index]]), step),
        *(
            _rescored(refined(flights, [*others, rival], step.floor), step)
            for rival in _tried(step)
            if rival.effect.name not in names
        ),
        *(scored for scored in ranked if not late([scored.candidate])),
    ]


def chance_beside_its_like(
    flights: Sequence[WeakFlight],
    chosen: Sequence[Candidate],
    index: int,
    effects: Sequence[Effect],
    settings: GapSettings,
) -> float:
    """Compute how likely it is that an effect between command and rotors adds nothing to its like.

    Shifted residuals cannot tell: each of these effects moves with the command, and so does what the others leave.
    Compared is therefore what all effects, and the others without it, leave of blocks that their fits did not see, both
    with all shapes moved, by the signed-rank test of Wilcoxon; times the number of effects that could have stood there.

    Parameters
    ----------
    index : int
        Of the effect among them.
    effects : sequence of Effect
        That the search tried.
    """
    together = system(flights, chosen)
    floor = best_floor(together)
    without = refined(flights, [other for place, other in enumerate(chosen) if place != index], floor)
    margin = more_left(_unseen(without, floor, settings), _unseen(together, floor, settings))
    tried = sum(effect.actuation is not None for effect in effects)
    return min(1.0, tried * chance_of_ranks(margin)) if len(margin) > 1 else 1.0


def _unseen(hypothesis: System, floor: Array, settings: GapSettings) -> Array:
    """Compute what a hypothesis leaves of each block that a fit of coefficients and shapes did not see."""
    plain = system(hypothesis.flights)
    weight = floor / compensation(plain.rotor_wrench, hypothesis.rotor_wrench)
    arranged = scoring_matrix(hypothesis, (), weight)
    normal = normal_equations(arranged, hypothesis.residual, weight, block_index(hypothesis, settings))
    return np.asarray(normal.solve(arranged.base)[1][:, 0])


def _stands_for_two(chosen: Sequence[Candidate], index: int) -> bool:
    """Tell whether an effect is the only one between command and rotors and has as many shapes as two others."""
    effect = chosen[index].effect
    return effect.actuation is not None and len(effect.shapes) > 1 and not beside_its_like(chosen, index)


def _tried(step: RankedStep) -> list[Candidate]:
    """List the effects between command and rotors that were not refused."""
    return late([scored.candidate for scored in step.ranking if np.isfinite(scored.gain)])


def _pairs(flights: Sequence[WeakFlight], others: Sequence[Candidate], step: RankedStep) -> list[System]:
    """Fit each two effects between command and rotors that have one shape."""
    single = [candidate for candidate in _tried(step) if len(candidate.effect.shapes) == 1]
    return [refined(flights, [*others, *pair], step.floor) for pair in combinations(single, 2)]


def _wider_pairs(
    flights: Sequence[WeakFlight], others: Sequence[Candidate], own: Candidate, step: RankedStep
) -> list[System]:
    """Fit another effect between command and rotors that has two shapes with each one that has one shape."""
    tried = _tried(step)
    double = [each for each in tried if len(each.effect.shapes) > 1 and each.effect.name != own.effect.name]
    single = [each for each in tried if len(each.effect.shapes) == 1]
    return [refined(flights, [*others, *pair], step.floor) for pair in product(double, single)]


def _enough(step: RankedStep, beside: Scored) -> float:
    """Compute the least gain, in squared floors, of what is added to a hypothesis."""
    return least_gain(max(step.above_floor - beside.gain, 0.0), len(step.hypothesis.residual))


def _rescored(refitted: System, step: RankedStep) -> Scored:
    """Score the last effect of a hypothesis by what that leaves of each block."""
    plain = system(refitted.flights)
    square = weighted_residual(refitted, step.floor, plain.rotor_wrench) ** 2
    error = np.bincount(step.block, square.sum(axis=1)).astype(float)
    gain = step.above_floor + rows(plain) - error.sum()
    return Scored(refitted.chosen[-1], np.zeros(0, dtype=int), float(gain), error, np.zeros(0))
