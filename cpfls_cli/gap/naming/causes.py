"""Causes of a gap: each chosen effect jointly with the others, faults of sensors, wrong parameters of the vehicle."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from cpfls_cli.arrays import Array
from cpfls_cli.consistency.findings import AuditFinding
from cpfls_cli.consistency.motion import OFFSET_M_S2
from cpfls_cli.effects.catalogue.parameter_error import NUMBERS
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.registry import CATALOGUE, VEHICLE_NUMBERS
from cpfls_cli.gap.balance.balance_system import is_free, system
from cpfls_cli.gap.balance.refine import fit
from cpfls_cli.gap.balance.weak_flight import WeakFlight
from cpfls_cli.gap.naming.estimate import Estimates, NamedFit, effect_sentence
from cpfls_cli.gap.naming.ranking import RankedStep, Scored, likely, odds, rank_effects
from cpfls_cli.gap.naming.results import Alternative, Estimate, LikelySet, NamedEffect
from cpfls_cli.gap.naming.search import alternative, alternatives, chance_given_actuation, in_place_of
from cpfls_cli.gap.settings import COUNTS, ERRORS, RARE, GapSettings
from cpfls_cli.rounding import ascending
from cpfls_cli.vehicle.settings import VehicleSettings

_MATTERS = 0.02  # Relative error of a moment of inertia or of the thrust from which on it is named.


@dataclass(frozen=True)
class JudgedEffect:
    """A chosen effect and its rivals."""

    effect: NamedEffect
    alternatives: tuple[Alternative, ...]
    # Of each set with others in its place, against the chosen one: logarithm of the predictive density of each block.
    odds: Mapping[tuple[str, ...], Array]


def judge_effects(found: NamedFit, effects: Sequence[Effect], rng: np.random.Generator) -> list[JudgedEffect]:
    """Judge each named effect as if it were the last one to be found."""
    hypothesis, estimates, settings = found.hypothesis, found.estimates, found.settings
    flights, chosen = hypothesis.flights, hypothesis.chosen
    judged = []
    for index, share in enumerate(shares(found).tolist()):
        candidate, numbers = chosen[index], estimates.effects[index]
        others = [*chosen[:index], *chosen[index + 1 :]]
        chance = chance_given_actuation(hypothesis, index, effects, settings)
        step = rank_effects(flights, others, effects, settings, rng if chance is None else None, also=(candidate,))
        own, *ranking = in_place_of(candidate, step)
        effect = NamedEffect(
            name=candidate.effect.name,
            shape=candidate.shape,
            linear=estimates.of_effect[index],
            numbers=numbers,
            p_value=step.p_value(own.gain) if chance is None else chance,
            share=share,
            sentence=effect_sentence(candidate.effect, numbers, hypothesis.vehicle),
        )
        rivals, compared = _rivals(own, ranking, step, settings)
        if flights[0].lasting.size and not candidate.effect.is_lag:
            # A gust lasts: what of it was there before says nothing about a set. What gusts are off by is no formula's.
            flown, floor = [flight.innovations for flight in flights], step.floor * np.sqrt(hypothesis.most_noise)
            step = rank_effects(flown, others, effects, settings, None, also=(candidate,), floor=floor)
            own, *ranking = in_place_of(candidate, step)
            known, also = _rivals(own, ranking, step, settings)
            # Of innovations the loop answers more at once, so that they add no rival.
            rivals = tuple(each for each in rivals if each.name in {rival.name for rival in known})
            compared = {
                names: min(own_odds, also.get(names, own_odds), key=np.sum) for names, own_odds in compared.items()
            }
        judged.append(JudgedEffect(effect, (*rivals, *_added_alone(candidate.effect, numbers)), compared))
    return judged


def _added_alone(effect: Effect, numbers: Sequence[Estimate]) -> Iterator[Alternative]:
    """Give the rival of an effect of which only what its exact form adds is surely not 0."""
    plain = CATALOGUE[effect.name]
    sure = {each.name for each in numbers if each.low > 0 or each.high < 0}
    if plain.added and sure and not sure & {each.name for each in plain.coefficients}:
        yield alternative(effect, CATALOGUE[plain.added], 1.0)


def _rivals(
    own: Scored, ranking: Sequence[Scored], step: RankedStep, settings: GapSettings
) -> tuple[tuple[Alternative, ...], dict[tuple[str, ...], Array]]:
    """List the rivals of an effect, and the odds of each set with another one in its place."""
    compared = {
        tuple(each.effect.name for each in other.chosen): odds(own, other, step.above_floor)
        for other in ranking
        if np.isfinite(other.gain) and own.candidate.effect.name not in other.candidate.effect.holds
    }
    return tuple(alternatives(own, ranking, step.above_floor, settings)), compared


def likely_sets(judged: Sequence[JudgedEffect]) -> tuple[LikelySet, ...]:
    """List the chosen set and those with others in the place of one of its effects, most likely first."""
    if not judged:
        return ()
    chosen = tuple(each.effect.name for each in judged)
    others = {frozenset(names): (names, odds) for each in judged for names, odds in each.odds.items()}
    others.pop(frozenset(chosen), None)
    weights = likely([odds for _, odds in others.values()]).tolist()
    listed = zip([chosen, *(names for names, _ in others.values())], weights, strict=True)
    sets = ascending((LikelySet(names, weight) for names, weight in listed), lambda each: -each.likely)
    return tuple(each for each in sets if each.likely >= RARE)


def shares(found: NamedFit) -> Array:
    """Split the explained part of the residual among the effects, shape (effect,).

    The share of an effect is the part of the explained residual that points its way, in floors; the shares add up to
    1. Effects that work against each other can have more than 1, or less than 0.
    """
    chosen, estimates = found.hypothesis.chosen, found.estimates

    def remaining(kept: Sequence[int]) -> Array:
        """Compute the residual with some of the effects only, at the coefficients of all of them."""
        linear = [estimates.of_effect[index] for index in kept if is_free(chosen[index])]
        hypothesis = system(found.hypothesis.flights, [chosen[index] for index in kept])
        return hypothesis.residual_at(np.concatenate([estimates.of_vehicle, *linear])) / found.floor

    indices = range(len(chosen))
    everything = remaining(indices)
    total = remaining(()) - everything
    parts = (remaining([other for other in indices if other != index]) - everything for index in indices)
    along = np.array([(part * total).sum() for part in parts])
    return np.asarray(along / max(abs(along.sum()), 1e-12))


def wrong_numbers(
    estimates: Estimates,
    effects: Mapping[str, Sequence[Estimate]],
    removed: Array,
    unknown: Array,
    vehicle: VehicleSettings,
) -> NamedEffect | None:
    """Name the numbers of the vehicle that are significantly wrong, relevant, and not explained by a named effect.

    Where inertia over rotor torque shows a wrong thrust too, the mass is right.

    `effects`: the numbers of those that are named.
    `removed`, shape (6,): part of each channel's gap on unseen flights that refitting the numbers takes off.
    `unknown`, shape (6,): residual of each channel where that is clear, relative to the motion: if all of it went
    with the motion, as where a loop answers it, the number of that channel would be off by so much.
    """
    # Each shows in a channel of its own.
    shown, hidden = (dict(zip(NUMBERS, (*each[:3], each[5]), strict=True)) for each in (removed, unknown))
    named = [
        (CATALOGUE[name].accounts, {number.name: number.value for number in numbers})
        for name, numbers in effects.items()
    ]
    wrong = []
    for number in (each for each in estimates.parameters if each.name in NUMBERS):
        accounted = sum(accounts(number.name, values, vehicle) for accounts, values in named if accounts is not None)
        # At the rate of errors of names, over all numbers that are asked.
        least = max(_MATTERS, accounted, hidden[number.name])
        sure = len(NUMBERS) * _chance(number) <= RARE and abs(number.value) > least
        if sure and shown[number.name] >= COUNTS:
            wrong.append(number)
    if not wrong:
        return None
    share = float(max(shown[number.name] for number in wrong))
    p_value = min(_chance(number) for number in wrong)
    sentence = effect_sentence(VEHICLE_NUMBERS, [] if of_thrust(wrong) else wrong, vehicle)
    return _without_columns(VEHICLE_NUMBERS.name, tuple(wrong), p_value, share, sentence)


def of_thrust(numbers: Sequence[Estimate]) -> list[str]:
    """List moments of inertia that are right where the thrust is wrong: rates show their ratio to the rotor torque.

    That is where a moment of inertia times the thrust is that of the config within 99 %, however their errors go
    together.
    """
    known = {number.name: number for number in numbers}
    thrust = known.pop("thrust_scale", None)
    moments = {name: each for name, each in known.items() if name.startswith("inertia_")}
    return [] if thrust is None else [name for name, each in moments.items() if _undone(each, thrust)]


def with_lever(effect: NamedEffect, wrong: NamedEffect | None) -> NamedEffect:
    """Give an effect that has a lever for all forces the lever of the forces as they are, where the thrust is wrong.

    Its torque is known over that of the rotors. If their thrust is larger than stated their torque is too, and if the
    mass is smaller the force is: either way the measured force is too large for the lever by what the thrust is off.

    `wrong`: numbers of the vehicle that are named as wrong.
    """
    thrust = None if wrong is None else wrong.coefficients.get("thrust_scale")
    if thrust is None or not CATALOGUE[effect.name].of_all_forces:
        return effect
    scale, error = 1 + thrust.value, 0.5 * (thrust.high - thrust.low)

    def scaled(number: Estimate) -> Estimate:
        down, up = (
            float(np.hypot(scale * (end - number.value), error * number.value)) for end in (number.low, number.high)
        )
        value = scale * number.value
        return replace(number, value=value, low=value - down, high=value + up)

    return replace(effect, numbers=tuple(scaled(number) for number in effect.numbers))


def _undone(number: Estimate, other: Estimate) -> bool:
    """Check whether two relative errors cancel as factors."""
    off = (1 + number.value) * (1 + other.value) - 1
    own, its = ((1 + b.value) * 0.5 * (a.high - a.low) for a, b in ((number, other), (other, number)))
    return _chance_of(off, own + its) > RARE


def carries_the_weight(found: NamedFit) -> bool:
    """Check whether the scale of the thrust, within its interval, is that which carries the weight on the mean.

    It shows by how force and thrust change as well, and where an effect is missing that may be another one. The mean
    is off by no more than an accelerometer is; or by less than half of what it is with the thrust as stated, where the
    accelerometer is off by more.
    """
    number = next(each for each in found.estimates.parameters if each.name == "thrust_scale")
    flights = [replace(flight, offset_share=np.zeros(6), seen={}) for flight in found.hypothesis.flights]
    there = system(flights, found.hypothesis.chosen)
    lift, vehicle, stated = float(there.rotor_wrench[:, 5].mean()), there.vehicle, found.estimates.linear.copy()
    stated[[each.name for each in VEHICLE_NUMBERS.coefficients].index(number.name)] = 0.0
    left, before = (abs(float(there.residual_at(each)[:, 5].mean())) for each in (found.estimates.linear, stated))
    known = ERRORS * OFFSET_M_S2 * vehicle.mass_kg + lift * 0.5 * (number.high - number.low)
    return left <= max(known, (1 - found.settings.partial_share) * before)


def all_numbers(estimates: Estimates) -> tuple[Estimate, ...]:
    """List the numbers of the vehicle in the order of the catalogue; the interval of one that is not known is NaN."""
    known, nothing = {each.name: each for each in estimates.parameters}, (np.nan, np.nan)
    return tuple(
        known.get(own.name) or Estimate(own.name, own.unit, float(value), *nothing, nothing)
        for own, value in zip(VEHICLE_NUMBERS.coefficients, estimates.of_vehicle, strict=True)
    )


def _chance(number: Estimate) -> float:
    """Compute the probability that a number as far from 0 is chance."""
    return _chance_of(number.value, 0.5 * (number.high - number.low))


def _chance_of(value: float, half: float) -> float:
    return 2 * float(ndtr(-1.96 * abs(value) / half)) if half > 0 else 0.0


def impossible_ratios(numbers: Sequence[Estimate]) -> dict[str, float]:
    """Give the numbers of the vehicle that no vehicle has, by their relative errors, as ratios to the config."""
    return {number.name: 1 + number.value for number in numbers if number.name in NUMBERS and number.impossible}


def sensor_fault(
    finding: AuditFinding, as_logged: Sequence[WeakFlight], as_repaired: Sequence[WeakFlight]
) -> NamedEffect:
    """Name a fault of the sensors with the share of the gap that its repair removes from the training flights."""
    logged, repaired = system(as_logged), system(as_repaired)
    weight = np.sqrt(np.mean(repaired.residual**2, axis=0)) + 1e-12
    before, after = (((each.residual_at(fit(each, weight)) / weight) ** 2).sum() for each in (logged, repaired))
    share = float(np.clip(1 - after / max(before, 1e-12), 0, 1))
    effect = CATALOGUE[finding.name]
    assert effect.test is not None, "the audit tests what has a test"
    by_label = dict(zip(effect.test.labels, effect.numbers, strict=True))
    numbers = tuple(
        Estimate(known.name, known.unit, number.value, number.low, number.high, known.bounds(repaired.vehicle))
        for number in finding.coefficients
        if number.named and (known := by_label[number.name])
    )
    return _without_columns(finding.name, numbers, finding.p_value, share, finding.sentence)


def _without_columns(
    name: str, numbers: tuple[Estimate, ...], p_value: float, share: float, sentence: str
) -> NamedEffect:
    """Name what is no part of a model: a fault of the sensors, or wrong numbers of the vehicle."""
    return NamedEffect(
        name=name, shape={}, linear=np.zeros(0), numbers=numbers, p_value=p_value, share=share, sentence=sentence
    )
