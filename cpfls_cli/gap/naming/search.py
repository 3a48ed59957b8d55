"""Forward selection of the effects that explain a gap, tested against chance, with exchange and rivals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import gumbel_r, wilcoxon

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.balance.balance_system import System, floors, system
from cpfls_cli.gap.balance.refine import compensation, fit, refined, weighted_residual
from cpfls_cli.gap.balance.resampling import blocks_of, mirror_shifted
from cpfls_cli.gap.balance.weak_flight import CHANNELS, Candidate, WeakFlight
from cpfls_cli.gap.naming.results import Alternative
from cpfls_cli.gap.naming.scoring import (
    REFUSED,
    Layout,
    Scored,
    candidates_of,
    chance,
    layout,
    normal_equations,
    score,
)
from cpfls_cli.gap.settings import GapSettings

_LEAST_SHARE = 0.05
"""Share of the remaining gap above the floor that an effect has to explain."""

_LEAST_IN_FLOORS = 0.3
"""Root mean square that an effect has to explain of one channel, in floors."""
_CLOSE = 0.01
_VISIBLE = 0.25
_ERRORS = 2.0
_CHANCE = 0.02
_NEAR = 0.6


@dataclass(frozen=True)
class SearchStep:
    """All candidates ranked beside a hypothesis.

    Attributes
    ----------
    hypothesis : System
    floor : array, shape (6,)
    ranking : tuple of Scored
        Best first, each effect once, at its best shape.
    chance : array, shape (shift,)
        What the best candidate explains of shifted residuals.
    above_floor : float
        Sum of squares that the hypothesis leaves above the floor, in squared floors.
    block : array of int, shape (window,)
    """

    hypothesis: System
    floor: Array
    ranking: tuple[Scored, ...]
    chance: Array
    above_floor: float
    block: IntArray

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
        return float(min(reached, gumbel_r.sf(gain, np.mean(self.chance) - np.euler_gamma * scale, scale)))


def rank_effects(
    flights: Sequence[WeakFlight],
    chosen: Sequence[Candidate],
    effects: Sequence[Effect],
    settings: GapSettings,
    rng: np.random.Generator | None,
    also: Sequence[Candidate] = (),
) -> SearchStep:
    """Score all effects beside those chosen.

    Parameters
    ----------
    flights : sequence of WeakFlight
    chosen : sequence of Candidate
    effects : sequence of Effect
        To be scored.
    settings : GapSettings
    rng : numpy.random.Generator or None
        Of the shifts; None for none.
    also : sequence of Candidate
        Tried beside the grids, with shapes of their own.
    """
    hypothesis = system(flights, chosen)
    floor = best_floor(hypothesis)
    names = {candidate.effect.name for candidate in chosen}
    listed = [*candidates_of([effect for effect in effects if effect.name not in names]), *also]
    tried = [candidate for candidate in listed if hypothesis.can(candidate)]
    arranged = layout(hypothesis, tried, floor)
    block = block_index(hypothesis, settings)
    normal = normal_equations(arranged, hypothesis.residual, floor, block)
    ranking = _each_once(score(arranged, normal, hypothesis))
    residual = hypothesis.residual - hypothesis.base @ fit(hypothesis, floor)
    before = normal.solve(arranged.base)[1][:, 0]
    return SearchStep(
        hypothesis,
        floor,
        ranking,
        _chance(arranged, residual, hypothesis, floor, block, settings, rng),
        float(max(before.sum() - _rows(hypothesis), 1e-9)),
        block,
    )


def forward_selection(
    flights: Sequence[WeakFlight],
    effects: Sequence[Effect],
    settings: GapSettings,
    rng: np.random.Generator,
    progress: Callable[[int], None] = lambda _: None,
) -> tuple[tuple[Candidate, ...], list[SearchStep]]:
    """Add effects one at a time while each explains more than chance and a relevant part of the residual.

    Parameters
    ----------
    flights : sequence of WeakFlight
    effects : sequence of Effect
    settings : GapSettings
    rng : numpy.random.Generator
    progress : callable
        Takes the number of looks done.

    Returns
    -------
    chosen : tuple of Candidate
    steps : list of SearchStep
        The last one has nothing to add.
    """
    chosen: tuple[Candidate, ...] = ()
    steps: list[SearchStep] = []
    tried: set[frozenset[str]] = {frozenset()}
    while True:
        step = rank_effects(flights, chosen, effects, settings, rng)
        steps.append(step)
        progress(len(steps))
        if len(chosen) >= settings.effects_max or not acceptable(step, settings):
            return chosen, steps
        best = simplest(_moved(flights, chosen, step), step.above_floor)
        refitted = refined(flights, [*chosen, best.candidate], step.floor)
        if not quiet_enough(best.gain, step, refitted):
            return chosen, steps
        kept = exchanged(flights, refitted.chosen, effects, settings) if len(refitted.chosen) > 1 else refitted.chosen
        names = frozenset(candidate.effect.name for candidate in kept)
        # An exchange can undo what was added; a set that was there before would come round again for ever.
        if names in tried:
            return chosen, steps
        tried.add(names)
        chosen = kept
        step.hypothesis.cache.clear()


def acceptable(step: SearchStep, settings: GapSettings) -> bool:
    """Tell whether the best candidate explains more than chance and a relevant part of the residual."""
    if not step.ranking or step.ranking[0].gain == REFUSED:
        return False
    best = step.ranking[0]
    return best.gain >= _enough(step) and step.p_value(best.gain) <= settings.significance


def _enough(step: SearchStep) -> float:
    """Compute the least gain of an effect that is named, in squared floors."""
    return least_gain(step.above_floor, len(step.hypothesis.residual))


def quiet_enough(gain: float, step: SearchStep, refitted: System) -> bool:
    """Tell whether an effect explains motion, not noise.

    Columns of rates hold the noise of the gyroscope, and so does the inertial torque: where rates about two axes go
    hand in hand, a fit can turn one against the other and be rid of noise. What an effect takes off the floor is
    therefore taken off its gain.

    Parameters
    ----------
    gain : float
        What it explains, in squared floors.
    step : SearchStep
        The look that chose it.
    refitted : System
        With the effect.
    """
    if not refitted.chosen[-1].effect.rate_derivative:
        return True
    after = floors(refitted, fit(refitted, step.floor))
    rows = np.sum([len(flight) * flight.known for flight in refitted.flights], axis=0)
    noise = float((rows * np.maximum(1 - (after / step.floor) ** 2, 0.0)).sum())
    return gain - noise >= _enough(step)


def exchanged(
    flights: Sequence[WeakFlight], chosen: Sequence[Candidate], effects: Sequence[Effect], settings: GapSettings
) -> tuple[Candidate, ...]:
    """Drop effects that later ones made needless, and exchange those that another beats beside the rest."""
    kept = list(chosen)
    for candidate in list(chosen):
        others = [other for other in kept if other is not candidate]
        step = rank_effects(flights, others, effects, settings, None, also=(candidate,))
        scored = next((each for each in step.ranking if each.candidate.effect.name == candidate.effect.name), None)
        small = scored is None or scored.gain < _LEAST_SHARE * step.above_floor
        if scored is None or small or len(_late(others)) > 1:
            without = _do_without(flights, others, kept, step.floor)
            kept = kept if without is None else without
            if scored is None or small or without is not None:
                continue
        best = step.ranking[0]
        worse = best.candidate.effect.name != candidate.effect.name and scored not in unbeaten(
            best, step.ranking, step.above_floor
        )
        # Beside other effects its own shape may be another one: a delay that is dropped leaves its time to a lag.
        better = best.candidate if worse else scored.candidate
        if better is not candidate:
            kept = list(refined(flights, [*others, better], step.floor).chosen)
    return tuple(kept)


def _late(chosen: Sequence[Candidate]) -> list[Candidate]:
    """List the effects between command and rotors: two of them, with other shapes, can do what a third does."""
    return [candidate for candidate in chosen if candidate.effect.actuation is not None]


def _do_without(
    flights: Sequence[WeakFlight], others: list[Candidate], kept: Sequence[Candidate], floor: Array
) -> list[Candidate] | None:
    """Refine effects without one of them, if they then explain as much; None if they do not.

    The derivatives by the shapes promise more, or less, where the shapes have to move far.
    """
    if not any(candidate.effect.shapes for candidate in others):
        return others
    plain, without = system(flights), refined(flights, others, floor)
    left, before = (
        float((weighted_residual(there, floor, plain.rotor_wrench) ** 2).sum())
        for there in (without, system(flights, kept))
    )
    return list(without.chosen) if left - before < _LEAST_SHARE * max(left - _rows(plain), 0.0) else None


def best_floor(hypothesis: System) -> Array:
    """Estimate the noise floors from the residual of a hypothesis.

    The fit and the floors depend on each other; starting from equal weights, a second round changes nothing any more.

    Returns
    -------
    array, shape (6,)
    """
    rows = hypothesis.residual
    floor = np.where(rows.any(axis=0), np.sqrt(np.mean(rows**2, axis=0)), 1.0)
    for _ in range(2):
        floor = floors(hypothesis, fit(hypothesis, floor))
    return floor


def block_index(hypothesis: System, settings: GapSettings) -> IntArray:
    """Assign each window to a block of the cross-validation.

    Returns
    -------
    array of int, shape (window,)
    """
    centres = np.concatenate([f.windows.centres(f.signals.time) for f in hypothesis.flights])
    return blocks_of(hypothesis.flight_index, centres, settings.block_s)


def _chance(
    arranged: Layout,
    residual: Array,
    hypothesis: System,
    floor: Array,
    block: IntArray,
    settings: GapSettings,
    rng: np.random.Generator | None,
) -> Array:
    if rng is None:
        return np.zeros(0)
    draws = mirror_shifted(residual, hypothesis.flight_index, settings.shifts, rng)
    return chance(arranged, normal_equations(arranged, draws, floor, block))


def _each_once(ranking: Sequence[Scored]) -> tuple[Scored, ...]:
    seen: dict[str, Scored] = {}
    for scored in ranking:
        seen.setdefault(scored.candidate.effect.name, scored)
    return tuple(seen.values())


def _rows(hypothesis: System) -> int:
    return sum(len(flight) * int(flight.known.sum()) for flight in hypothesis.flights)


def unbeaten(chosen: Scored, ranking: Sequence[Scored], above_floor: float) -> list[Scored]:
    """List the candidates that the chosen one does not beat.

    Beaten is what leaves more by more than the scatter over blocks and by more than a few hundredths of the gap.
    """
    return [
        other
        for other in ranking
        if other.candidate.effect.name != chosen.candidate.effect.name
        and other.gain > _NEAR * chosen.gain
        and not _beats(chosen, other, above_floor)
    ]


def simplest(ranking: Sequence[Scored], above_floor: float) -> Scored:
    """Choose among the best candidates the one with the fewest free numbers.

    Parameters
    ----------
    ranking : sequence of Scored
        Best first.
    above_floor : float
    """
    best = ranking[0]
    rivals = [other for other in unbeaten(best, ranking, above_floor) if other.gain > (1 - _CLOSE) * best.gain]
    return min([best, *rivals], key=lambda scored: (_numbers(scored), -scored.gain))


def alternatives(chosen: Scored, ranking: Sequence[Scored], above_floor: float) -> list[Alternative]:
    """List the rivals of a chosen effect, without effects that hold it as a special case."""
    effect = chosen.candidate.effect
    return [
        Alternative(
            other.name,
            effect.name,
            float(scored.gain / chosen.gain),
            effect.rivals.get(other.name) or other.rivals.get(effect.name) or effect.excitation,
        )
        for scored in unbeaten(chosen, ranking, above_floor)
        if effect.name not in (other := scored.candidate.effect).holds
    ]


def beside_its_like(chosen: Sequence[Candidate], index: int) -> bool:
    """Tell whether an effect and another one lie between command and rotors, where each can stand for the other."""
    return chosen[index].effect.actuation is not None and len(_late(chosen)) > 1


def settled(flights: Sequence[WeakFlight], chosen: Sequence[Candidate], index: int, step: SearchStep) -> list[Scored]:
    """Score an effect between command and rotors and its like beside another one, once all shapes have moved.

    There a point of a grid is no test: where a lag stands for a delay, the width of a notch moves with it.

    Parameters
    ----------
    flights : sequence of WeakFlight
    chosen : sequence of Candidate
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
    if not beside_its_like(chosen, index):
        return ranked
    names = {each.effect.name for each in chosen}
    tried = [scored.candidate for scored in step.ranking if np.isfinite(scored.gain)]
    return [
        _rescored(system(flights, [*others, chosen[index]]), step),
        *(
            _rescored(refined(flights, [*others, rival], step.floor), step)
            for rival in _late(tried)
            if rival.effect.name not in names
        ),
        *(scored for scored in ranked if not _late([scored.candidate])),
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
    flights : sequence of WeakFlight
    chosen : sequence of Candidate
    index : int
        Of the effect among them.
    effects : sequence of Effect
        That the search tried.
    settings : GapSettings
    """
    together = system(flights, chosen)
    floor = best_floor(together)
    without = refined(flights, [other for place, other in enumerate(chosen) if place != index], floor)
    margin = _unseen(without, floor, settings) - _unseen(together, floor, settings)
    tried = sum(effect.actuation is not None for effect in effects)
    return float(min(1.0, tried * wilcoxon(margin, alternative="greater").pvalue)) if len(margin) > 1 else 1.0


def _unseen(hypothesis: System, floor: Array, settings: GapSettings) -> Array:
    """Compute what a hypothesis leaves of each block that a fit of coefficients and shapes did not see."""
    plain = system(hypothesis.flights)
    weight = floor / compensation(plain.rotor_wrench, hypothesis.rotor_wrench)
    arranged = layout(hypothesis, (), weight)
    normal = normal_equations(arranged, hypothesis.residual, weight, block_index(hypothesis, settings))
    return np.asarray(normal.solve(arranged.base)[1][:, 0])


def _moved(flights: Sequence[WeakFlight], chosen: Sequence[Candidate], step: SearchStep) -> Sequence[Scored]:
    """Score anew, with all shapes moved, what lies between command and rotors and comes near the best, if that does.

    Between the points of a grid an effect with more shapes comes closer to what one with fewer is.
    """
    best = step.ranking[0]
    near = [s for s in step.ranking if _late([s.candidate]) and s.gain > _NEAR * best.gain]
    if best not in near or len(near) < 2:
        return step.ranking
    settled_there = [_rescored(refined(flights, [*chosen, s.candidate], step.floor), step) for s in near]
    return sorted(settled_there, key=lambda scored: -scored.gain)


def _rescored(refitted: System, step: SearchStep) -> Scored:
    """Score the last effect of a hypothesis by what that leaves of each block."""
    plain = system(refitted.flights)
    square = weighted_residual(refitted, step.floor, plain.rotor_wrench) ** 2
    error = np.bincount(step.block, square.sum(axis=1)).astype(float)
    gain = step.above_floor + _rows(plain) - error.sum()
    return Scored(refitted.chosen[-1], np.zeros(0, dtype=int), float(gain), error, np.zeros(0))


def _beats(chosen: Scored, other: Scored, above_floor: float) -> bool:
    margin = other.block_error - chosen.block_error
    if margin.sum() <= least_margin(above_floor, float(chosen.block_error.sum())) or len(margin) < 2:
        return False
    spread = float(np.std(margin, ddof=1) * np.sqrt(len(margin)))
    # Effects act in some blocks and not in others: where sizes differ that much, ranks tell more than the mean.
    return bool(margin.sum() > _ERRORS * spread or wilcoxon(margin, alternative="greater").pvalue < _CHANCE)


def least_gain(above_floor: float, windows: int) -> float:
    """Compute what an effect has to explain to be worth a name, in squared floors.

    Parameters
    ----------
    above_floor : float
        The gap, in squared floors.
    windows : int
    """
    return max(_LEAST_SHARE * above_floor, _LEAST_IN_FLOORS**2 * windows)


def least_margin(above_floor: float, left: float) -> float:
    """Compute the difference of two explanations up to which they are as good as each other.

    It is next to nothing of a large gap, or next to nothing beside what the better one leaves itself.

    Parameters
    ----------
    above_floor : float
        The gap, in squared floors.
    left : float
        What the better one leaves, in squared floors.
    """
    return min(_CLOSE * above_floor, _VISIBLE * left / len(CHANNELS))


def _numbers(scored: Scored) -> int:
    effect = scored.candidate.effect
    return len(effect.shapes) + (0 if effect.unit_coefficient else len(scored.coefficients))
