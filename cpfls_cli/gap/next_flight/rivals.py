"""The questions that a diagnosis, or a user, asks of the next flight."""

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import InputError
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import fit, least_squares, refined
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight
from cpfls_cli.gap.naming.open_questions import usual_size
from cpfls_cli.gap.naming.ranking import candidates_of, known_before
from cpfls_cli.gap.naming.results import Alternative, NamedEffect
from cpfls_cli.gap.next_flight.separation import Question, SizedEffect, answered, gathered
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.rounding import smallest
from cpfls_cli.vehicle.settings import VehicleSettings


def require_visible(effects: Sequence[Effect], source: str, vehicle: VehicleSettings) -> None:
    """Refuse effects that no torque and no force shows.

    `source`: file or key that named them, for the message. Raises InputError: it names the effect and what shows it.
    """
    for effect in effects:
        if effect.columns is None:
            raise InputError(
                f"{source}: {effect.name} is a sensor fault, found from the sensors alone and not by a planned "
                f"flight; what shows it: {effect.excitation}"
            )
        if "rotor_radius" in effect.needs and any(rotor.radius_m is None for rotor in vehicle.rotors):
            raise InputError(
                f"{source}: {effect.name} needs vehicle.rotors.radius_m of every rotor; add it to the config"
            )
    actuators = [effect.name for effect in effects if "command" in effect.needs]
    measured = [effect.name for effect in effects if "measured_rotor_speed" in effect.needs]
    if actuators and measured:
        raise InputError(
            f"{source}: {actuators[0]} shows if commands are logged instead of rotor speeds, {measured[0]} if "
            "rotor speeds are measured; no single flight separates them. Log measured rotor speeds: they rule out "
            f"{actuators[0]}"
        )


def questions_between(effects: Sequence[Effect], vehicle: VehicleSettings) -> tuple[Question, ...]:
    """Ask for every two effects, either way, whether they would be separated at a usual size.

    One effect alone asks whether it shows at all.
    """
    sized = [usual(effect, vehicle) for effect in effects]
    alone = (Question(sized[0], None),) if len(sized) == 1 else ()
    asked = alone or (Question(true, rival.candidate.effect) for true, rival in permutations(sized, 2))
    return tuple(question for question in asked if _is_open(question))


def _is_open(question: Question) -> bool:
    """Check whether there is a question: an effect is also what holds it as a special case."""
    effect, rival = question.true.candidate.effect, question.rival
    return effect.kind != "parameter" and (rival is None or effect.name not in rival.holds)


def usual(effect: Effect, vehicle: VehicleSettings) -> SizedEffect:
    """Give an effect a size that is large but not unheard of."""
    candidate = Candidate(effect, {shape.name: shape.grid[len(shape.grid) // 2] for shape in effect.shapes})
    numbers = np.ones(len(effect.coefficients) or 1)
    width = len(numbers if effect.physical is None else effect.physical.linear(numbers))
    return SizedEffect(candidate, usual_size(effect, vehicle, width))


def open_questions(
    named: Sequence[NamedEffect],
    rivals: Sequence[Alternative],
    unseen: Sequence[Effect],
    flights: Sequence[WeakFlight],
    floor: Array,
    settings: GapSettings,
) -> tuple[Question, ...]:
    """Ask what a diagnosis left open: which of two rivals it is, and what its flights could not show.

    `unseen`: to show at a usual size; `flights`: of the diagnosis, repaired; `floor`: shape (6,), N m and N.
    """
    sized = {
        each.name: SizedEffect(each.candidate, each.linear if len(each.linear) else np.ones(1))
        for each in named
        if each.candidate is not None
    }
    questions, others = [], []
    for rival in rivals:
        one = sized[rival.instead_of]
        besides = tuple(each for name, each in sized.items() if name not in (rival.instead_of, rival.name))
        other = fitted_rival(flights, [each.candidate for each in besides], CATALOGUE[rival.name], floor)
        pair = (one, other.candidate.effect), (other, one.candidate.effect)
        questions += [Question(true, effect, besides) for true, effect in pair]
        others += [Question(true, each, besides) for true, known in pair for each in _alike(true, known, flights)]
    questions += [each for each in others if not _is_answered(each, flights, floor, settings)]
    once = {(each.true.candidate.effect.name, each.rival and each.rival.name): each for each in questions}
    asked = tuple(question for question in once.values() if _is_open(question))
    return (*asked, *(Question(usual(effect, flights[0].signals.vehicle), None) for effect in unseen))


def _alike(true: SizedEffect, rival: Effect, flights: Sequence[WeakFlight]) -> list[Effect]:
    """List what else looks like an effect by the catalogue, and must not take the place of the rival."""
    others = (CATALOGUE[name] for name in true.candidate.effect.rivals if name != rival.name)
    known = (each for each in others if each.columns is not None and each.kind == true.candidate.effect.kind)
    return [each for each in known if not all(each.missing(flight.signals) for flight in flights)]


def _is_answered(question: Question, flights: Sequence[WeakFlight], floor: Array, settings: GapSettings) -> bool:
    """Check whether the flights that are there answer a question."""
    if all(question.true.candidate.effect.missing(flight.signals) for flight in flights):
        return False
    return answered([gathered(question, flights, floor, settings)])[0].settled


def fitted_effects(flights: Sequence[WeakFlight], chosen: Sequence[Candidate], floor: Array) -> tuple[SizedEffect, ...]:
    """Fit effects together on flights; what the flights leave open stays small against its bounds.

    `chosen`: their shapes are kept; `floor`: shape (6,), N m and N.
    """
    balance = system(flights, chosen)
    matrix = (balance.base / floor[:, None]).reshape(-1, balance.base.shape[2])
    prior = known_before(balance)[: balance.base.shape[2]]
    # Rows of the prior below those of the flights.
    matrix = np.concatenate([matrix, np.diag(np.sqrt(prior))])
    linear = least_squares(matrix, np.concatenate([(balance.residual / floor).reshape(-1), np.zeros(len(prior))]))
    by_name = {each.effect.name: linear[place] for each, place in balance.places}
    return tuple(SizedEffect(each, by_name.get(each.effect.name, np.ones(1))) for each in chosen)


def fitted_rival(
    flights: Sequence[WeakFlight], besides: Sequence[Candidate], rival: Effect, floor: Array
) -> SizedEffect:
    """Fit a rival in place of a named effect, at its best shape; at a usual size where the flights lack its signals.

    `besides`: the other named effects; `floor`: shape (6,), N m and N.
    """
    if all(rival.missing(flight.signals) for flight in flights):
        return usual(rival, flights[0].signals.vehicle)

    def error(candidate: Candidate) -> float:
        balance = system(flights, [*besides, candidate])
        return float(((balance.residual_at(fit(balance, floor)) / floor) ** 2).sum())

    best = smallest(candidates_of([rival]), error)
    return fitted_effects(flights, refined(flights, [*besides, best], floor).chosen, floor)[-1]


def physical_values(sized: SizedEffect) -> dict[str, float]:
    """Give the physical coefficients and shapes of an effect by name; those that are open are 0."""
    effect, shape = sized.candidate
    if effect.unit_coefficient:
        return dict(shape)
    physical = np.nan_to_num(sized.linear if effect.physical is None else effect.physical.of(sized.linear))
    names = (coefficient.name for coefficient in effect.coefficients)
    return {**dict(zip(names, physical.tolist(), strict=False)), **shape}
