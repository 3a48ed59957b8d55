"""Forward selection of the effects that explain a gap, tested against chance, with exchange and rivals."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.balance.balance_system import System, floors, system
from cpfls_cli.gap.balance.refine import fit, refined, weighted_residual
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight
from cpfls_cli.gap.naming.actuation import late, moved, parted, without_companion
from cpfls_cli.gap.naming.ranking import (
    CLOSE,
    LEAST_SHARE,
    NEAR,
    RankedStep,
    least_gain,
    least_margin,
    more_left,
    rank_effects,
    rows,
    surely_less,
)
from cpfls_cli.gap.naming.results import Alternative
from cpfls_cli.gap.naming.scoring import (
    REFUSED,
    Scored,
)
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.rounding import largest, less


def forward_selection(
    flights: Sequence[WeakFlight],
    effects: Sequence[Effect],
    settings: GapSettings,
    rng: np.random.Generator,
    progress: Callable[[int], None] = lambda _: None,
) -> tuple[tuple[Candidate, ...], list[RankedStep]]:
    """Add effects one at a time while each explains more than chance and a relevant part of the residual.

    Parameters
    ----------
    progress : callable
        Takes the number of looks done.

    Returns
    -------
    chosen : tuple of Candidate
    steps : list of SearchStep
        The last one has nothing to add.
    """
    chosen: tuple[Candidate, ...] = ()
    steps: list[RankedStep] = []
    tried: set[frozenset[str]] = {frozenset()}
    while True:
        step = rank_effects(flights, chosen, effects, settings, rng)
        steps.append(step)
        progress(len(steps))
        if len(chosen) >= settings.effects_max or not acceptable(step, settings):
            return chosen, steps
        best = simplest(moved(flights, chosen, step), step.above_floor)
        refitted = parted(refined(flights, [*chosen, best.candidate], step.floor), step)
        if not quiet_enough(best.gain, step, refitted):
            return chosen, steps
        refitted = without_companion(refitted, step, settings)
        kept = exchanged(flights, refitted.chosen, effects, settings) if len(refitted.chosen) > 1 else refitted.chosen
        names = frozenset(candidate.effect.name for candidate in kept)
        # An exchange can undo what was added; a set that was there before would come round again for ever.
        if names in tried:
            return chosen, steps
        tried.add(names)
        chosen = kept
        step.hypothesis.cache.clear()


def acceptable(step: RankedStep, settings: GapSettings) -> bool:
    """Tell whether the best candidate explains more than chance and a relevant part of the residual."""
    if not step.ranking or step.ranking[0].gain == REFUSED:
        return False
    best = step.ranking[0]
    return best.gain >= _enough(step) and step.p_value(best.gain) <= settings.significance


def _enough(step: RankedStep) -> float:
    """Compute the least gain of an effect that is named, in squared floors."""
    return least_gain(step.above_floor, len(step.hypothesis.residual))


def quiet_enough(gain: float, step: RankedStep, refitted: System) -> bool:
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
        small = scored is None or scored.gain < LEAST_SHARE * step.above_floor
        if scored is None or small or len(late(others)) > 1:
            without = _do_without(flights, others, kept, step.floor)
            kept = kept if without is None else without
            if scored is None or small or without is not None:
                continue
        ranking = moved(flights, others, step)
        best = simplest(ranking, step.above_floor)
        # What has moved is all that lies between command and rotors; this one may not.
        scored = next((each for each in ranking if each.candidate.effect.name == candidate.effect.name), scored)
        rivals = unbeaten(best, [*ranking, scored], step.above_floor)
        worse = best is not scored and (scored not in rivals or _numbers(best) < _numbers(scored))
        # Beside other effects its own shape may be another one: a delay that is dropped leaves its time to a lag.
        better = best.candidate if worse else scored.candidate
        if better is not candidate:
            kept = list(refined(flights, [*others, better], step.floor).chosen)
    return tuple(kept)


def _do_without(
    flights: Sequence[WeakFlight], others: list[Candidate], kept: Sequence[Candidate], floor: Array
) -> list[Candidate] | None:
    """Refine effects without one of them, if they then explain as much; None if they do not."""
    if not any(candidate.effect.shapes for candidate in others):
        return others
    plain, without = system(flights), refined(flights, others, floor)
    left, before = (
        float((weighted_residual(there, floor, plain.rotor_wrench) ** 2).sum())
        for there in (without, system(flights, kept))
    )
    needless = less(left - before, LEAST_SHARE * max(left - rows(plain), 0.0), left)
    return list(without.chosen) if needless else None


def unbeaten(chosen: Scored, ranking: Sequence[Scored], above_floor: float) -> list[Scored]:
    """List the candidates that the chosen one does not beat.

    Beaten is what leaves more by more than the scatter over blocks and by more than a few hundredths of the gap.
    """
    return [
        other
        for other in ranking
        if other.candidate.effect.name != chosen.candidate.effect.name
        and other.gain > NEAR * chosen.gain
        and not (_clearly_less(chosen, other, above_floor) and surely_less(chosen, other))
    ]


def simplest(ranking: Sequence[Scored], above_floor: float) -> Scored:
    """Choose among the best candidates the one with the fewest free numbers.

    Parameters
    ----------
    ranking : sequence of Scored
        Best first.
    """
    best = ranking[0]
    rivals = [other for other in unbeaten(best, ranking, above_floor) if other.gain > (1 - CLOSE) * best.gain]
    fewest = min(_numbers(each) for each in [best, *rivals])
    return largest([each for each in [best, *rivals] if _numbers(each) == fewest], lambda scored: scored.gain)


def alternatives(chosen: Scored, ranking: Sequence[Scored], above_floor: float) -> list[Alternative]:
    """List the rivals of a chosen effect, without effects that hold it as a special case."""
    effect = chosen.candidate.effect
    return [
        Alternative(
            other.name,
            effect.name,
            float(scored.gain / chosen.gain),
            effect.rivals.get(other.name) or other.rivals.get(effect.name) or effect.excitation,
            "" if scored.beside is None else scored.beside.name,
        )
        for scored in unbeaten(chosen, ranking, above_floor)
        if effect.name not in (other := scored.candidate.effect).holds
    ]


def _clearly_less(chosen: Scored, other: Scored, above_floor: float) -> bool:
    """Tell whether one explanation leaves less than another by more than next to nothing."""
    margin = float(more_left(other.block_error, chosen.block_error).sum())
    return margin > least_margin(above_floor, float(chosen.block_error.sum()))


def _numbers(scored: Scored) -> int:
    """Count the numbers that a candidate is free to choose."""
    effect = scored.candidate.effect
    return len(effect.shapes) + (0 if effect.unit_coefficient else len(scored.coefficients))
