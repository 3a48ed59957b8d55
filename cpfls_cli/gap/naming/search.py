"""A search over sets of effects: a beam, its sets compared by what they leave of blocks that no fit saw."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.balance.balance_system import System, floors, system
from cpfls_cli.gap.balance.refine import compensation, fit, refined
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight
from cpfls_cli.gap.naming.ranking import (
    RankedStep,
    best_floor,
    block_index,
    chance_of_ranks,
    likely,
    log_odds,
    more_left,
    off_by,
    rank_effects,
)
from cpfls_cli.gap.naming.results import Alternative
from cpfls_cli.gap.naming.scoring import Scored, scoring_matrix
from cpfls_cli.gap.settings import OFF, RARE, GapSettings
from cpfls_cli.rounding import ascending, less
from cpfls_cli.weak_form.resampling import folds

_BEAM = 3
"""Sets that are followed at once: a lag, a delay and a filter each do alone most of what two of them do."""


def forward_selection(
    flights: Sequence[WeakFlight],
    effects: Sequence[Effect],
    settings: GapSettings,
    rng: np.random.Generator,
    progress: Callable[[int], None] = lambda _: None,
) -> tuple[tuple[Candidate, ...], list[RankedStep]]:
    """Let sets grow by one effect at a time while the best explains more than chance and a relevant part of the gap.

    Parameters
    ----------
    progress : callable
        Takes the number of looks done.

    Returns
    -------
    chosen : tuple of Candidate
    steps : list of RankedStep
        Of the best set of each size; the last one has nothing to add.
    """
    beam: list[tuple[Candidate, ...]] = [()]
    steps: list[RankedStep] = []
    tried: set[frozenset[str]] = {frozenset()}
    while True:
        chosen = beam[0]
        step = rank_effects(flights, chosen, effects, settings, rng)
        steps.append(step)
        progress(len(steps))
        if len(chosen) >= settings.effects_max:
            return chosen, steps
        grown = _moved(flights, step, settings) if acceptable(step, settings) else []
        grown += grown_elsewhere(flights, beam[1:], step, effects, settings)
        if not grown:
            return chosen, steps
        number = float(np.log(step.hypothesis.known.sum()))
        best = simplest(ascending(grown, lambda scored: -scored.gain), step.above_floor, number)
        refitted = refined(flights, best.chosen, step.floor)
        # A set that was there before would come round again for ever.
        if of_motion(best.gain, step, refitted) < step.worth_a_name() or _names(refitted.chosen) in tried:
            return chosen, steps
        tried.add(_names(refitted.chosen))
        step.hypothesis.cache.clear()
        beam = [refitted.chosen, *(scored.chosen for scored in grown if scored is not best)][:_BEAM]


def acceptable(step: RankedStep, settings: GapSettings) -> bool:
    """Tell whether the best candidate explains more than chance and a relevant part of the residual."""
    best = max((scored.gain for scored in step.ranking), default=-np.inf)
    return best >= step.worth_a_name() and step.p_value(best) <= settings.significance


def _moved(flights: Sequence[WeakFlight], step: RankedStep, settings: GapSettings) -> list[Scored]:
    """List the candidates that explain something; those between command and rotors, if the best is, with shapes moved.

    Between the points of a grid an effect with more shapes comes closer to what one with fewer is.
    """
    best = step.ranking[0]
    near = [scored for scored in step.ranking if scored.gain > 0]
    alike = [scored for scored in near if _late(scored)]
    beside_late = any(each.effect.actuation is not None for each in best.others)
    if best not in alike or not (beside_late or len(alike) > 1):
        return near
    return [rescored(refined(flights, scored.chosen, step.floor), step, settings) for scored in alike]


def grown_elsewhere(
    flights: Sequence[WeakFlight],
    sets: Sequence[Sequence[Candidate]],
    step: RankedStep,
    effects: Sequence[Effect],
    settings: GapSettings,
) -> list[Scored]:
    """List sets that grew from others than the best one and leave less than that with no more numbers.

    Where the best one leaves nothing, nothing is looked for. Two that a filter stands for may have a number more.
    """
    chosen = step.hypothesis.chosen
    two = bool(sets) and stands_for_two(chosen, len(chosen) - 1)
    if not sets or not (two or step.above_floor > step.worth_a_name()):
        return []
    most = _numbers(chosen) + two
    own, found = rescored(step.hypothesis, step, settings), list[Scored]()
    for other in sets:
        late = any(each.effect.actuation is not None for each in other)
        like = [each for each in effects if each.actuation is not None] if late else effects
        there = rank_effects(flights, other, like, settings, None, floor=step.floor)
        for scored in there.ranking[: _BEAM if late else 1]:
            if _names(scored.chosen) != _names(chosen) and _numbers(scored.chosen) <= most:
                grown = refined(flights, scored.chosen, step.floor) if late else system(flights, scored.chosen)
                found.append(rescored(grown, step, settings))
    return [scored for scored in found if _is_better(scored, own, step)]


def _is_better(scored: Scored, own: Scored, step: RankedStep) -> bool:
    """Tell whether a set leaves less than another one; with more numbers it has to beat that one."""
    if _numbers(scored.chosen) > _numbers(own.chosen):
        return not unbeaten(scored, [own], step.above_floor)
    return bool(less(0.0, scored.gain - own.gain, step.above_floor))


def of_motion(gain: float, step: RankedStep, with_it: System) -> float:
    """Take off a gain what of it is noise, in squared floors.

    Columns of rates hold the noise of the gyroscope, and so does the inertial torque: where rates about two axes go
    hand in hand, a fit can turn one against the other and be rid of noise. What an effect takes off the floor is
    therefore taken off its gain.
    """
    if not with_it.chosen[-1].effect.rate_derivative:
        return gain
    after = floors(with_it, fit(with_it, step.floor))
    return gain - float((with_it.known.sum(axis=0) * np.maximum(1 - (after / step.floor) ** 2, 0.0)).sum())


def in_place_of(
    flights: Sequence[WeakFlight], chosen: Sequence[Candidate], index: int, step: RankedStep, settings: GapSettings
) -> list[Scored]:
    """Score an effect, and behind it all that could stand in its place, beside the look at the others and it.

    What lies between command and rotors is scored with shapes moved, and two of these can stand for one with two
    shapes; more numbers than it has have to be worth it.
    """
    ranked = sorted(step.ranking, key=lambda scored: scored.candidate.effect.name != chosen[index].effect.name)
    if chosen[index].effect.actuation is None:
        return ranked
    others = [other for place, other in enumerate(chosen) if place != index]
    own = rescored(system(flights, [*others, chosen[index]]), step, settings)
    alike = [each.candidate for each in ranked[1:] if _late(each) and np.isfinite(each.gain)]
    sets: list[tuple[Candidate, ...]] = [(each,) for each in alike]
    if stands_for_two(chosen, index):
        sets += combinations(alike, 2)
    numbers, worth = _numbers(own.chosen), step.above_floor - own.gain > step.worth_a_name(own.gain)
    sets = [each for each in sets if worth or _numbers([*others, *each]) <= numbers]
    moved = [rescored(refined(flights, [*others, *each], step.floor), step, settings) for each in sets]
    fair = [each for each in moved if _numbers(each.chosen) <= numbers or _is_better(each, own, step)]
    return [own, *fair, *(scored for scored in ranked[1:] if not _late(scored))]


def stands_for_two(chosen: Sequence[Candidate], index: int) -> bool:
    """Tell whether an effect is the only one between command and rotors and has as many shapes as two others."""
    effect = chosen[index].effect
    return effect.actuation is not None and len(effect.shapes) > 1 and not beside_its_like(chosen, index)


def beside_its_like(chosen: Sequence[Candidate], index: int) -> bool:
    """Tell whether an effect and another one lie between command and rotors, where each can stand for the other."""
    between = [each.effect.actuation is not None for each in chosen]
    return between[index] and sum(between) > 1


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
    """
    together = system(flights, chosen)
    floor = best_floor(together)
    without = refined(flights, [other for place, other in enumerate(chosen) if place != index], floor)
    margin = more_left(_unseen(without, floor, settings), _unseen(together, floor, settings))
    tried = sum(effect.actuation is not None for effect in effects)
    return min(1.0, tried * chance_of_ranks(margin)) if len(margin) > 1 else 1.0


def rescored(hypothesis: System, step: RankedStep, settings: GapSettings) -> Scored:
    """Score a set, with its shapes where they are, by what it leaves of each block that no fit saw."""
    plain, own = system(hypothesis.flights).rotor_wrench, step.hypothesis.rotor_wrench
    # Beside the best set, whose rotor torque is what it is in the look. Shapes that are refined stay.
    moving = all(each.effect.actuation is None for each in hypothesis.chosen)
    error = _unseen(hypothesis, step.floor * compensation(plain, own), settings, moving=moving)
    gain = step.above_floor + hypothesis.known.sum() - error.sum()
    *others, newest = hypothesis.chosen
    return Scored(newest, float(gain), error, np.zeros(0), tuple(others))


def _unseen(hypothesis: System, floor: Array, settings: GapSettings, *, moving: bool = True) -> Array:
    """Compute what a hypothesis leaves of each block that a fit of coefficients, and of moving shapes, did not see."""
    weight = floor / compensation(system(hypothesis.flights).rotor_wrench, hypothesis.rotor_wrench)
    arranged = scoring_matrix(hypothesis, (), weight)
    normal = folds(arranged.matrix, hypothesis.residual / weight, block_index(hypothesis, settings), arranged.prior)
    return np.asarray(normal.solve(arranged.base if moving else np.arange(hypothesis.base.shape[2]))[1][:, 0])


def unbeaten(chosen: Scored, ranking: Sequence[Scored], above_floor: float) -> list[Scored]:
    """List the candidates that the chosen one does not beat: those that are not rare beside it."""
    known = _names(chosen.chosen)
    others = [each for each in ranking if np.isfinite(each.gain) and _names(each.chosen) != known]
    own, *weights = likely([odds(chosen, other, above_floor) for other in others])
    return [each for each, weight in zip(others, weights, strict=True) if weight >= RARE * own]


def odds(own: Scored, other: Scored, above_floor: float) -> Array:
    """Compare two sets by what they leave of unseen blocks, beside what their formulas are off by.

    Returns
    -------
    array, shape (block,)
        Logarithm of the predictive density under the other one less that under the first.
    """
    off = min(OFF**2 * above_floor, max(above_floor - own.gain, 0.0))
    return log_odds(more_left(other.block_error, own.block_error), off)


def simplest(ranking: Sequence[Scored], above_floor: float, number: float) -> Scored:
    """Choose among the best candidates the one with the fewest free numbers.

    Parameters
    ----------
    ranking : sequence of Scored
        Best first.
    number : float
        What a free number has to explain, in squared floors: the logarithm of the number of residuals (Schwarz 1978).
    """
    best = ranking[0]
    # What formulas are off by.
    off = off_by(above_floor, float(best.block_error.sum()), above_floor - best.gain)
    rivals = [
        other
        for other in unbeaten(best, ranking, above_floor)
        if best.gain - other.gain < max(off, number * (_numbers(best.chosen) - _numbers(other.chosen)))
    ]
    fewest = min(_numbers(each.chosen) for each in [best, *rivals])
    few = [each for each in [best, *rivals] if _numbers(each.chosen) == fewest]
    most = max(each.gain for each in few)
    # What no number could tell apart is told by what is usual: rotors always lag.
    return min(
        (each for each in few if most - each.gain < number),
        key=lambda scored: sorted(each.effect.order for each in scored.chosen),
    )


def alternatives(
    chosen: Scored, ranking: Sequence[Scored], above_floor: float, settings: GapSettings
) -> list[Alternative]:
    """List the rivals of a chosen effect that explain a fair part of what it does.

    Those that hold it as a special case are none.
    """
    effect, known = chosen.candidate.effect, _names(chosen.chosen)
    found = []
    for scored in unbeaten(chosen, ranking, above_floor):
        *beside, other = (each.effect for each in scored.chosen if each.effect.name not in known)
        if effect.name not in other.holds and scored.gain > settings.partial_share * chosen.gain:
            found.append(alternative(effect, other, float(scored.gain / chosen.gain), *(each.name for each in beside)))
    return found


def alternative(effect: Effect, other: Effect, relative_gain: float, beside: str = "") -> Alternative:
    """Say what tells an effect from another one."""
    told = effect.rivals.get(other.name) or other.rivals.get(effect.name) or effect.excitation
    return Alternative(other.name, effect.name, relative_gain, told, beside)


def _late(scored: Scored) -> bool:
    """Tell whether a candidate lies between command and rotors."""
    return scored.candidate.effect.actuation is not None


def _names(chosen: Sequence[Candidate]) -> frozenset[str]:
    return frozenset(each.effect.name for each in chosen)


def _numbers(chosen: Sequence[Candidate]) -> int:
    """Count the numbers that a set is free to choose."""
    effects = [each.effect for each in chosen]
    return sum(len(each.shapes) + (0 if each.unit_coefficient else len(each.coefficients)) for each in effects)
