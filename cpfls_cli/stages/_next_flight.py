"""The next flight of `trajectory`: plan what settles a diagnosis, or separates named effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cpfls_cli.artifacts.diagnosis import Diagnosis
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.registry import CATALOGUE, VEHICLE_NUMBERS, acting
from cpfls_cli.effects.registry import effect as find
from cpfls_cli.effects.signals import TRAINING, in_roles
from cpfls_cli.errors import ComputationError, InputError, SettingError, about
from cpfls_cli.flights.path import PathQuestion, PlannedPath
from cpfls_cli.flights.same_vehicle import read_result_of_vehicle
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import fit
from cpfls_cli.gap.balance.weak_flight import Preparation, WeakFlight
from cpfls_cli.gap.naming.ranking import best_floor, block_index
from cpfls_cli.gap.naming.results import Alternative, GapVerdict
from cpfls_cli.gap.next_flight.rivals import (
    Answer,
    Question,
    formulas_off,
    open_questions,
    physical_values,
    questions_between,
    require_visible,
)
from cpfls_cli.gap.next_flight.room import Room, room_of
from cpfls_cli.gap.next_flight.search import (
    Goal,
    Logging,
    NextFlight,
    expected_floor,
    flown_signals,
    goal,
    logged_signals,
    needed_signals,
    next_flight,
    planned_signals,
)
from cpfls_cli.gap.residual.air import air, known_motion
from cpfls_cli.pages.gap import unit_words
from cpfls_cli.report.content import number
from cpfls_cli.simulation.inverse import flyability
from cpfls_cli.stage import Run
from cpfls_cli.stages._flight import demand_sentences
from cpfls_cli.stages._numbers import with_numbers
from cpfls_cli.trajectory.planning import Trajectory, repeated
from cpfls_cli.weak_form.windows import common_windows

_PERIOD = 0.02
"""Most time between samples that a search looks at, s."""

_SAMPLES_IN_A_WINDOW = 20
_OPEN = (GapVerdict.NOT_EXCITED, GapVerdict.NO_GAP)
"""Verdicts that leave open what the flights could not show."""


@dataclass(frozen=True)
class Case:
    """What is to be separated, from which flights on, and what a user should know of it."""

    questions: tuple[Question, ...]
    flights: tuple[WeakFlight, ...]
    logging: Logging
    notes: tuple[str, ...]


def planned(run: Run, diagnosis: Path | None = None) -> PlannedPath | None:
    """Plan the flight that decides most; None in a dry run."""
    study = run.study
    with_numbers(run, "trajectory", None)
    run.take({"diagnosis": diagnosis} if diagnosis else {})
    with settings_of("trajectory", study):
        period = min(_PERIOD, study.gap.window_s / _SAMPLES_IN_A_WINDOW)
        room = room_of(study.trajectory, study.vehicle, study.gap.ground_height_m, period)
    case = _named(study, room) if diagnosis is None else _left_open(study, diagnosis)
    if run.dry_run:
        return None
    asked = goal(case.questions, case.flights, room, case.logging)
    flight = next_flight(asked, generator(study, "next-flight"), run.progress)
    path = room.planned(flight.path, study.trajectory.sample_time_s)
    demand = flyability(vars(path), study.vehicle, study.trajectory.tilt_max_rad)
    problems = demand_sentences(demand, path)
    if problems:
        raise ComputationError("\n".join([*problems, f"{run.output}: no path was written; lower trajectory.limits"]))
    questions, notes = _questions(study, asked, flight, path)
    for note in dict.fromkeys((*case.notes, *notes)):
        run.note(note)
    path = repeated(path, study.trajectory, study.vehicle.gravity_m_s2)
    return PlannedPath.of(path, demand, study.trajectory, questions=questions)


def _effects(study: Study) -> list[Effect]:
    key = "trajectory.next_flight.separate"
    with about(key, InputError):
        names = [find(name).name for name in dict.fromkeys(study.trajectory.next_flight.separate)]
    effects = [acting(name, study.vehicle) for name in names]
    require_visible(effects, key, study.vehicle)
    return effects


def _between(study: Study) -> tuple[Question, ...]:
    """Ask for effects that the config names, at usual sizes."""
    effects = _effects(study)
    questions = questions_between(effects, study.vehicle)
    if not questions:
        names = ", ".join(each.name for each in effects)
        raise InputError(
            f"trajectory.next_flight.separate = [{names}]: nothing to separate; name effects with --separate A,B "
            "(`cpfls effects` lists them), or give a diagnosis with --for DIAGNOSIS"
        )
    return questions


def _named(study: Study, room: Room) -> Case:
    """Ask for effects that the config names, at usual sizes, in logs with the noise of `simulation`."""
    effects, questions = _effects(study), _between(study)
    signals = needed_signals(effects) | {"attitude", "position", "velocity", "acceleration"}
    blank = Logging(signals, any("command" in each.needs for each in effects), np.ones(6), study.gap)
    rng = generator(study, "next-flight noise")
    floor = expected_floor(room, blank, study.simulation, study.trajectory.sample_time_s, rng)
    logging = Logging(signals, blank.commanded, floor, study.gap)
    return Case(questions, (), logging, () if study.simulation.noise else (_NO_NOISE,))


_NO_NOISE = (
    "simulation.noise is empty, so the floors are no more than rounding and 0.3 % of torque and weight: to learn how "
    "sure the flight is with real logs, give --for DIAGNOSIS, or the noise of the sensors in simulation.noise"
)


def _left_open(study: Study, path: Path) -> Case:
    """Ask what a diagnosis leaves open, or for the effects that the config names with what the diagnosis knows."""
    found, _ = read_result_of_vehicle(path, Diagnosis, study)
    base, ground = found.base.fuzzy, study.gap.ground_height_m
    recorded = [each.flight(study.vehicle, ground) for each in in_roles(found.recorded, TRAINING)]
    prepared = Preparation(common_windows(recorded, study.gap), base, study.gap, found.audit)
    flights = tuple(prepared.repaired(recorded))
    named = [each for each in found.effects or found.closest if each.candidate is not None]
    chosen = [each.candidate for each in named if each.candidate is not None]
    explained = system(flights, chosen)
    floor = best_floor(explained)
    gusts = None
    if found.air is not None:
        # What a file holds of them lacks the noise with them.
        linear, block = fit(explained, floor), block_index(explained, study.gap)
        known = air(explained, linear, block, known_motion(recorded), study.gap)
        gusts = known if known is not None and known.split.any() else None
    if gusts is not None:
        flights = tuple(gusts.around(flights, gusts.floor(flights, flights)))
        explained = system(flights, chosen)
        floor = best_floor(explained)
    # Of gusts, whose size is an estimate, no more is taken for an error of formulas than a gap begins at.
    above = floor * np.sqrt(explained.most_noise) if gusts is not None else floor
    rivals, unseen = _open_effects(study, found, flights, path)
    # What a diagnosis did not weigh is asked for at usual sizes.
    weighed = open_questions(named, rivals, unseen, flights, floor, study.gap)
    questions = weighed or _between(study)
    effects = [each.true.candidate.effect for each in questions]
    logged = logged_signals(flights[0].signals)
    more = needed_signals(effects) - logged
    notes = (f"log {', '.join(sorted(more))} too: the flights so far lack it, and without it no flight can show it",)
    commanded = any("command" in each.needs for each in effects) or flights[0].signals.commanded
    logging = Logging(logged | more, commanded, floor, study.gap, base, formulas_off(explained, above), gusts)
    return Case(questions, flights, logging, notes if more else ())


def _open_effects(
    study: Study, found: Diagnosis, flights: Sequence[WeakFlight], path: Path
) -> tuple[list[Alternative], list[Effect]]:
    """List the rivals that a diagnosis leaves, or what its flights could not show; nothing for effects not weighed."""
    asked = _effects(study)
    # Between an effect and two that together do the same no path decides: the log has to.
    rivals = [each for each in found.alternatives if not each.jointly_with]
    visible = [name for name, effect in CATALOGUE.items() if effect.columns is not None and effect.kind != "parameter"]
    rivals = [each for each in rivals if each.name in visible and each.instead_of in found.effects_of_motion]
    if asked:
        names = {each.name for each in asked}
        rivals = [each for each in rivals if {each.name, each.instead_of} <= names]
    if rivals:
        require_visible([CATALOGUE[each.name] for each in rivals], str(path), study.vehicle)
        return rivals, []
    # Numbers of the vehicle are free in every fit: of their rivals it is asked whether they show.
    of_numbers = [each for each in found.alternatives if each.instead_of == VEHICLE_NUMBERS.name]
    hidden = [acting(each.name, study.vehicle) for each in of_numbers or found.not_excited if each.name in visible]
    unseen = [each for each in hidden if not all(each.missing(flight.signals) for flight in flights)]
    if asked:
        return [], []
    if not unseen or not (of_numbers or found.verdict in _OPEN):
        raise InputError(
            f"{path}: its verdict is {found.verdict}, and it leaves nothing to separate; to plan a flight all the "
            "same name effects with --separate A,B"
        )
    return [], unseen


def _questions(
    study: Study, asked: Goal, flight: NextFlight, planned: Trajectory
) -> tuple[list[PathQuestion], list[str]]:
    """Judge the path that was found, as planned and as flown, against other flights."""
    room, logging = asked.room, asked.logging
    answers = asked.answers(planned_signals(planned, room, logging))
    usual = asked.answers(planned_signals(room.planned(flight.random[len(flight.random) // 2]), room, logging))
    again = asked.answers(None)
    flown, notes = _flown(study, asked, planned)
    rows = zip(asked.questions, answers, flown, again, usual, strict=True)
    return [
        PathQuestion(
            true=(true := each.true.candidate.effect.name),
            rival=(rival := each.rival.name if each.rival else ""),
            size=size_words(each.true.candidate.effect, physical_values(each.true)),
            likely=own.likely,
            sure=own.sure,
            likely_flown=by_autopilot.likely if by_autopilot else np.nan,
            flown=by_autopilot.sure if by_autopilot else np.nan,
            again=once_more.sure if len(once_more.evidence.gram) else np.nan,
            random=random.sure,
            least=own.least_size,
            smallest=_smallest(each, own),
            advice=advice_words(CATALOGUE[true], CATALOGUE.get(rival)),
        )
        for each, own, by_autopilot, once_more, random in rows
    ], notes


def size_words(effect: Effect, values: Mapping[str, float]) -> str:
    """Write the numbers of an effect that are not zero."""
    units = {each.name: unit_words(each.unit) for each in effect.numbers}
    return ", ".join(f"{name} = {number(value, 3)} {units[name]}".rstrip() for name, value in values.items() if value)


def advice_words(effect: Effect, rival: Effect | None) -> str:
    """Give the flight that the catalogue advises."""
    if rival is None:
        return effect.excitation
    return effect.rivals.get(rival.name) or rival.rivals.get(effect.name) or effect.excitation


def _smallest(question: Question, answer: Answer) -> str:
    """Write the size from which on a question is settled, where an effect is linear in its numbers."""
    effect = question.true.candidate.effect
    if effect.unit_coefficient or effect.physical is not None or np.isnan(answer.least_size):
        return ""
    names = {coefficient.name for coefficient in effect.coefficients}
    values = physical_values(question.true).items()
    return size_words(effect, {name: answer.least_size * value for name, value in values if name in names})


def _flown(study: Study, asked: Goal, planned: Trajectory) -> tuple[list[Answer | None], list[str]]:
    """Fly the plan in closed loop with each effect that may be true; not known where no autopilot flies it."""
    found, notes = [], []
    loop = study.simulation.closed_loop
    judged: dict[str, tuple[Answer, ...] | None] = {}
    for row, question in enumerate(asked.questions):
        name = question.true.candidate.effect.name
        if name not in judged:
            try:
                effects = [question.true, *question.besides]
                signals = flown_signals(planned, effects, study.vehicle, asked.logging, loop)
                judged[name] = asked.answers(signals)
            except (ComputationError, SettingError) as error:
                judged[name] = None
                notes.append(f"with {name} the flight was not simulated in closed loop: {error}")
        answers = judged[name]
        found.append(answers[row] if answers else None)
    return found, notes
