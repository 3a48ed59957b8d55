"""Command `trajectory` for a next flight: plan what settles a diagnosis, or tells named effects apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cpfls_cli.artifacts.diagnosis import Diagnosis
from cpfls_cli.artifacts.job import Job, begin, check_outputs, finish
from cpfls_cli.artifacts.output import write_text
from cpfls_cli.artifacts.trajectory import QuestionGroup, TrajectoryRecord
from cpfls_cli.commands.numbers import with_numbers
from cpfls_cli.commands.trajectory import figure_paths, to_simulate
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.registry import effect as find
from cpfls_cli.errors import ComputationError, InputError, SettingError, about
from cpfls_cli.export.mission import waypoint_lines
from cpfls_cli.flights.same_vehicle import read_result_of_vehicle
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.weak_flight import Preparation, WeakFlight
from cpfls_cli.gap.naming.ranking import best_floor
from cpfls_cli.gap.naming.results import Alternative, GapVerdict
from cpfls_cli.gap.next_flight.logged import (
    Logging,
    expected_floor,
    flown_signals,
    logged_signals,
    needed_signals,
    planned_signals,
)
from cpfls_cli.gap.next_flight.rivals import physical_values, questions_between, questions_left, require_tellable
from cpfls_cli.gap.next_flight.room import Room, room_of
from cpfls_cli.gap.next_flight.search import Goal, NextFlight, goal, next_flight
from cpfls_cli.gap.next_flight.separation import Answer, Question, formulas_off
from cpfls_cli.gap.recorded import TRAINING, in_roles
from cpfls_cli.pages.next_flight import advice_words, notes_blocks, size_words
from cpfls_cli.pages.source import source_of
from cpfls_cli.pages.trajectory import answer, demand_sentences, figure_names, path_figures, plan_blocks
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.simulation.inverse import flyability
from cpfls_cli.trajectory.planning import Trajectory
from cpfls_cli.trajectory.repeats import repeated
from cpfls_cli.weak_form.windows import common_windows

_PERIOD = 0.02
"""Most time between samples that a search looks at, s."""

_SAMPLES_IN_A_WINDOW = 20
_OPEN = (GapVerdict.NOT_EXCITED, GapVerdict.NO_GAP)
"""Verdicts that leave open what the flights could not show."""


@dataclass(frozen=True)
class Case:
    """What is to be told, from which flights on.

    Attributes
    ----------
    questions : tuple of Question
    flights : tuple of WeakFlight
        That are there already.
    logging : Logging
    notes : tuple of str
        What a user should know of it.
    """

    questions: tuple[Question, ...]
    flights: tuple[WeakFlight, ...]
    logging: Logging
    notes: tuple[str, ...]


def run(job: Job, diagnosis: Path | None = None, plot: bool = False) -> Outcome:
    """Plan the flight that tells most, and write it with waypoints for an autopilot."""
    study = job.study
    job = with_numbers(job, "trajectory", None)
    inputs = begin(job, {"diagnosis": diagnosis} if diagnosis else {})
    waypoints = job.output.with_name(f"{job.output.stem}-waypoints.csv")
    figures = figure_paths(job, figure_names(held=False) if plot else ())
    check_outputs(job, waypoints, *figures)
    with settings_of("trajectory", study):
        period = min(_PERIOD, study.gap.window_s / _SAMPLES_IN_A_WINDOW)
        room = room_of(study.trajectory, study.vehicle, study.gap.ground_height_m, period)
    case = _named(study, room) if diagnosis is None else _left_open(study, diagnosis)
    if job.dry_run:
        return nothing_written(job)
    asked = goal(case.questions, case.flights, room, case.logging)
    flight = next_flight(asked, generator(study, "next-flight"), job.progress)
    planned = room.planned(flight.path, study.trajectory.sample_time_s)
    demand = flyability(vars(planned), study.vehicle, study.trajectory.tilt_max_rad)
    problems = demand_sentences(demand, planned)
    if problems:
        raise ComputationError("\n".join([*problems, f"{job.output}: no path was written; lower trajectory.limits"]))
    questions, notes = _told(study, asked, flight, planned)
    planned = repeated(planned, study.trajectory, study.vehicle.gravity_m_s2)
    record = finish(job, TrajectoryRecord.of(planned, questions), inputs)
    write_text(waypoints, waypoint_lines(record))
    source = source_of(job, record)
    for path, drawn in zip(figures, path_figures(source) if figures else (), strict=True):
        write_text(path, drawn.picture.svg)
    blocks = [*plan_blocks(planned, demand, None), *answer(source), *notes_blocks([*case.notes, *notes])]
    blocks += [Text(f"written beside it: {', '.join(map(str, (waypoints, *figures)))}")]
    files = {"waypoints": str(waypoints), "figures": [str(path) for path in figures]}
    return Outcome(record.summary | files | {"duration_s": planned.duration}, tuple(blocks), next=(to_simulate(job),))


def _effects(study: Study) -> list[Effect]:
    key = "trajectory.next_flight.to_tell"
    with about(key, InputError):
        effects = [find(name) for name in dict.fromkeys(study.trajectory.next_flight.to_tell)]
    require_tellable(effects, key, study.vehicle)
    return effects


def _between(study: Study) -> tuple[Question, ...]:
    """Ask for effects that the config names, at usual sizes."""
    effects = _effects(study)
    questions = questions_between(effects, study.vehicle)
    if not questions:
        names = ", ".join(each.name for each in effects)
        raise InputError(
            f"trajectory.next_flight.to_tell = [{names}]: nothing to tell; name effects with --to-tell A,B (`cpfls "
            "effects` lists them), or give a diagnosis with --for DIAGNOSIS"
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
    recordings = [each.recording(study.vehicle, ground) for each in in_roles(found.recorded, TRAINING)]
    prepared = Preparation(common_windows(recordings, study.gap), base, study.gap, found.audit)
    flights = tuple(prepared.repaired(recordings))
    named = [each for each in found.effects or found.closest if each.candidate is not None]
    explained = system(flights, [each.candidate for each in named if each.candidate is not None])
    floor = best_floor(explained)
    rivals, unseen = _open_effects(study, found, flights, path)
    # What a diagnosis did not weigh is asked for at usual sizes.
    weighed = questions_left(named, rivals, unseen, flights, floor, study.gap)
    questions = weighed or _between(study)
    effects = [each.true.candidate.effect for each in questions]
    logged = logged_signals(flights[0].signals)
    more = needed_signals(effects) - logged
    notes = (f"log {', '.join(sorted(more))} too: the flights so far lack it, and without it no flight can tell",)
    commanded = any("command" in each.needs for each in effects) or flights[0].signals.commanded
    logging = Logging(logged | more, commanded, floor, study.gap, base, formulas_off(explained, floor))
    return Case(questions, flights, logging, notes if more else ())


def _open_effects(
    study: Study, found: Diagnosis, flights: Sequence[WeakFlight], path: Path
) -> tuple[list[Alternative], list[Effect]]:
    """List the rivals that a diagnosis leaves, or what its flights could not show; nothing for effects not weighed."""
    asked = _effects(study)
    # Between an effect and two that together do the same no path decides: the log has to.
    rivals = [each for each in found.alternatives if not each.beside]
    told = [name for name, effect in CATALOGUE.items() if effect.columns is not None and effect.kind != "parameter"]
    rivals = [each for each in rivals if each.name in told and each.instead_of in found.effects_of_motion]
    if asked:
        names = {each.name for each in asked}
        rivals = [each for each in rivals if {each.name, each.instead_of} <= names]
    if rivals:
        require_tellable([CATALOGUE[each.name] for each in rivals], str(path), study.vehicle)
        return rivals, []
    hidden = [CATALOGUE[each.name] for each in found.not_excited if each.name in told]
    unseen = [each for each in hidden if not all(each.missing(flight.signals) for flight in flights)]
    if asked:
        return [], []
    if found.verdict not in _OPEN or not unseen:
        raise InputError(
            f"{path}: its verdict is {found.verdict}, and it leaves nothing to tell apart; to plan a flight all the "
            "same name effects with --to-tell A,B"
        )
    return [], unseen


def _told(study: Study, asked: Goal, flight: NextFlight, planned: Trajectory) -> tuple[QuestionGroup, list[str]]:
    """Judge the path that was found, as planned and as flown, beside other flights."""
    room, logging = asked.room, asked.logging
    answers = asked.answers(planned_signals(planned, room, logging))
    usual = asked.answers(planned_signals(room.planned(flight.random[len(flight.random) // 2]), room, logging))
    again = asked.answers(None)
    flown, notes = _flown(study, asked, planned)
    names = [(each.true.candidate.effect.name, each.rival.name if each.rival else "") for each in asked.questions]
    return QuestionGroup(
        true=tuple(true for true, _ in names),
        rival=tuple(rival for _, rival in names),
        size=tuple(size_words(each.true.candidate.effect, physical_values(each.true)) for each in asked.questions),
        likely=np.array([each.likely for each in answers]),
        sure=np.array([each.sure for each in answers]),
        likely_flown=np.array([each.likely if each else np.nan for each in flown]),
        flown=np.array([each.sure if each else np.nan for each in flown]),
        again=np.array([each.sure if len(each.evidence.gram) else np.nan for each in again]),
        random=np.array([each.sure for each in usual]),
        least=np.array([each.least_size for each in answers]),
        smallest=tuple(_smallest(*pair) for pair in zip(asked.questions, answers, strict=True)),
        advice=tuple(advice_words(CATALOGUE[true], CATALOGUE.get(rival)) for true, rival in names),
    ), notes


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
