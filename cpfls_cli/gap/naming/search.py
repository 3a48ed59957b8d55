"""A search over sets of effects: a beam, its sets compared by their residual in blocks that no fit saw."""

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.balance.balance_system import System, floors, system
from cpfls_cli.gap.balance.refine import fit, refined, torque_loss_ratio
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight
from cpfls_cli.gap.naming.ranking import (
    RankedStep,
    Scored,
    best_floor,
    block_index,
    chance_of_ranks,
    free_numbers,
    more_residual,
    names_of,
    rank_effects,
    scoring_matrix,
    simplest,
    unbeaten,
)
from cpfls_cli.gap.naming.results import Alternative
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.rounding import ascending, less
from cpfls_cli.weak_form.windows import folds

_BEAM = 3  # Sets that are followed at once: a lag, a delay and a filter each do alone most of what two of them do.


def forward_selection(
    flights: Sequence[WeakFlight],
    effects: Sequence[Effect],
    settings: GapSettings,
    rng: np.random.Generator,
    progress: Callable[[int], None] = lambda _: None,
) -> tuple[tuple[Candidate, ...], list[RankedStep]]:
    """Let sets grow by one effect at a time while the best explains more than chance and a relevant part of the gap.

    At the end what took up others gives way. With the set come the looks at the best one of each size before that, the
    last of which has nothing to add. `progress` takes the number of looks done.
    """
    beam: list[tuple[Candidate, ...]] = [()]
    steps: list[RankedStep] = []
    tried: set[frozenset[str]] = {frozenset()}
    while True:
        chosen = beam[0]
        step = rank_effects(flights, chosen, effects, settings, rng)
        steps.append(step)
        progress(len(steps))
        most = len(chosen) >= settings.effects_max
        grown = _grown(step) if not most and acceptable(step, settings) else []
        grown += [] if most else grown_elsewhere(beam[1:], step, effects, settings)
        if not grown:
            return _exchanged(chosen, step, effects, settings), steps
        number = float(np.log(step.hypothesis.known.sum()))
        best = simplest(ascending(grown, lambda scored: -scored.gain), step.above_floor, number)
        refitted = refined(flights, best.chosen, step.floor)
        # A set that was there before would recur for ever.
        if of_motion(best.gain, step, refitted) < step.least_gain() or names_of(refitted.chosen) in tried:
            return _exchanged(chosen, step, effects, settings), steps
        tried.add(names_of(refitted.chosen))
        step.hypothesis.cache.clear()
        beam = [refitted.chosen, *(scored.chosen for scored in grown if scored is not best)][:_BEAM]


def _exchanged(
    chosen: tuple[Candidate, ...], step: RankedStep, effects: Sequence[Effect], settings: GapSettings
) -> tuple[Candidate, ...]:
    """Leave out what only took up effects that were found after it, or put a simpler one in its place."""
    flights = step.hypothesis.flights
    for place, candidate in enumerate(chosen[:-1]):
        if _lags([candidate]):
            continue
        others = (*chosen[:place], *chosen[place + 1 :])
        look = rank_effects(flights, others, effects, settings, None, also=(candidate,), floor=step.floor)
        best = simplest(look.ranking, look.above_floor, float(np.log(look.hypothesis.known.sum())))
        simpler = free_numbers(best.chosen) < free_numbers(chosen)
        if look.ranking[0].gain < look.least_gain():
            fewer = others
        elif simpler and best.candidate.effect.name != candidate.effect.name:
            fewer = best.chosen
        else:
            continue
        return _exchanged(refined(flights, fewer, step.floor).chosen, step, effects, settings)
    return chosen


def acceptable(step: RankedStep, settings: GapSettings) -> bool:
    """Check whether the best candidate explains more than chance and a relevant part of the residual."""
    best = max((scored.gain for scored in step.ranking), default=-np.inf)
    return best >= step.least_gain() and step.p_value(best) <= settings.significance


def _grown(step: RankedStep) -> list[Scored]:
    """List the candidates that explain something; those between command and rotors, if the best is, with shapes moved.

    Between the points of a grid an effect with more shapes comes closer to what one with fewer is.
    """
    best = step.ranking[0]
    near = [scored for scored in step.ranking if scored.gain > 0]
    alike = [scored for scored in near if _lags([scored.candidate])]
    if best not in alike or not (_lags(best.chosen[:-1]) or len(alike) > 1):
        return near
    moved = [_moved(scored.chosen, step) for scored in alike]
    return ascending(moved, lambda scored: -scored.gain)


def grown_elsewhere(
    sets: Sequence[Sequence[Candidate]], step: RankedStep, effects: Sequence[Effect], settings: GapSettings
) -> list[Scored]:
    """List sets that grew from others than the best one and leave less residual with no more numbers.

    Where the best one leaves nothing, nothing is looked for. Two that a filter stands for may have a number more.
    """
    if not sets:
        return []
    flights, chosen = step.hypothesis.flights, step.hypothesis.chosen
    two = _lags(chosen[-1:]) and not _lags(chosen[:-1]) and len(chosen[-1].effect.shapes) > 1
    if not (two or step.above_floor > step.least_gain()):
        return []
    own, found = _rescored(step.hypothesis, step), list[Scored]()
    for other in sets:
        lags = _lags(other)
        like = [each for each in effects if each.actuation is not None] if lags else effects
        there = rank_effects(flights, other, like, settings, None, floor=step.floor)
        for scored in there.ranking[: _BEAM if lags else 1]:
            grown = scored.chosen
            if names_of(grown) != names_of(chosen) and free_numbers(grown) <= free_numbers(chosen) + two:
                found.append(_moved(grown, step) if lags else _rescored(system(flights, grown), step))
    return [scored for scored in found if _is_better(scored, own, step)]


def _is_better(scored: Scored, own: Scored, step: RankedStep) -> bool:
    """Check whether a set leaves less than another one; with more numbers it has to beat that one."""
    if free_numbers(scored.chosen) > free_numbers(own.chosen):
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


def in_place_of(candidate: Candidate, step: RankedStep) -> list[Scored]:
    """Score an effect, and behind it all that could take its place, given the look at the others and it.

    What lies between command and rotors is scored with shapes moved, and two of these can replace one with two
    shapes; each number more than it has needs the gain of Schwarz's criterion, as in the choice.
    """
    ranked = sorted(step.ranking, key=lambda scored: scored.candidate.effect.name != candidate.effect.name)
    if not _lags([candidate]):
        return ranked
    others = step.hypothesis.chosen
    own = _rescored(system(step.hypothesis.flights, [*others, candidate]), step)
    alike = [each.candidate for each in ranked[1:] if _lags([each.candidate]) and np.isfinite(each.gain)]
    tried: list[tuple[Candidate, ...]] = [(*others, each) for each in alike]
    if len(candidate.effect.shapes) > 1 and not _lags(others):
        tried += [(*others, *pair) for pair in combinations(alike, 2)]
    numbers, moved = free_numbers(own.chosen), [_moved(each, step) for each in tried]
    worth = np.log(step.hypothesis.residual.size)
    more = [max(free_numbers(each.chosen) - numbers, 0) for each in moved]
    fair = [each for each, added in zip(moved, more, strict=True) if not added or each.gain - own.gain > added * worth]
    return [own, *fair, *(scored for scored in ranked[1:] if not _lags([scored.candidate]))]


def _lags(chosen: Sequence[Candidate]) -> bool:
    """Check whether any effect lies between command and rotors."""
    return any(each.effect.actuation is not None for each in chosen)


def chance_given_actuation(
    together: System, index: int, effects: Sequence[Effect], settings: GapSettings
) -> float | None:
    """Compute how likely it is that an effect between command and rotors adds nothing to its like; None without any.

    Shifted residuals cannot show it: each of these effects moves with the command, and so does the residual of the
    others. Compared are therefore the residuals of all effects, and of the others without it, in blocks that their fits
    did not see, both with all shapes moved, by the signed-rank test of Wilcoxon; times the number of effects that could
    have been there.
    """
    others = [*together.chosen[:index], *together.chosen[index + 1 :]]
    if not (_lags([together.chosen[index]]) and _lags(others)):
        return None
    floor, block = best_floor(together), block_index(together, settings)
    without = refined(together.flights, others, floor)
    margin = more_residual(_unseen(without, floor, block), _unseen(together, floor, block))
    tried = sum(effect.actuation is not None for effect in effects)
    return min(1.0, tried * chance_of_ranks(margin)) if len(margin) > 1 else 1.0


def _moved(chosen: Sequence[Candidate], step: RankedStep) -> Scored:
    """Score a set with its shapes refined."""
    return _rescored(refined(step.hypothesis.flights, chosen, step.floor), step)


def _rescored(hypothesis: System, step: RankedStep) -> Scored:
    """Score a set, with its shapes where they are, by its residual in each block that no fit saw."""
    # With the best set, whose rotor torque is what it is in the look.
    floor = step.floor * torque_loss_ratio(system(hypothesis.flights).rotor_wrench, step.hypothesis.rotor_wrench)
    # Shapes that are refined stay.
    error = _unseen(hypothesis, floor, step.block, moving=not _lags(hypothesis.chosen))
    gain = step.above_floor + hypothesis.known.sum() - error.sum()
    return Scored(hypothesis.chosen, float(gain), error, np.zeros(0))


def _unseen(hypothesis: System, floor: Array, block: IntArray, *, moving: bool = True) -> Array:
    """Compute the residual of each block that a fit of coefficients, and of moving shapes, did not see."""
    weight = floor / torque_loss_ratio(system(hypothesis.flights).rotor_wrench, hypothesis.rotor_wrench)
    arranged = scoring_matrix(hypothesis, (), weight)
    normal = folds(arranged.matrix, hypothesis.residual / weight, block, arranged.prior)
    columns = arranged.base if moving else arranged.base[: hypothesis.base.shape[2]]
    return np.asarray(normal.solve(columns)[1][:, 0])


def alternatives(
    chosen: Scored, ranking: Sequence[Scored], above_floor: float, settings: GapSettings
) -> list[Alternative]:
    """List the rivals of a chosen effect that explain a fair part of what it does.

    Those that hold it as a special case are none. What averages over windows do not show has no rivals there.
    """
    if chosen.gain <= 0:
        return []
    effect, known = chosen.candidate.effect, names_of(chosen.chosen)
    found = []
    for scored in unbeaten(chosen, ranking, above_floor):
        *jointly, other = (each.effect for each in scored.chosen if each.effect.name not in known)
        if effect.name not in other.holds and scored.gain > settings.partial_share * chosen.gain:
            found.append(alternative(effect, other, float(scored.gain / chosen.gain), *(each.name for each in jointly)))
    return found


def alternative(effect: Effect, other: Effect, relative_gain: float, jointly_with: str = "") -> Alternative:
    """Say what separates an effect from another one."""
    separated_by = effect.rivals.get(other.name) or other.rivals.get(effect.name) or effect.excitation
    return Alternative(other.name, effect.name, relative_gain, separated_by, jointly_with)
