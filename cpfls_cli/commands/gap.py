"""Command `gap`: compare, diagnose and extend in one go, with a report."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from cpfls_cli.artifacts.diagnosis import DiagnosisRecord
from cpfls_cli.artifacts.disagreement import DisagreementRecord
from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.artifacts.job import Job, go_on, input_file, take_inputs
from cpfls_cli.artifacts.learned import LearnedFlight
from cpfls_cli.artifacts.output import check_folder, filled_folder, refuse_inputs, write_text
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.commands import report
from cpfls_cli.commands.compare import check_ignored, compared, finish_disagreement, progress_of, with_seen
from cpfls_cli.commands.diagnose import (
    diagnosed,
    finish_diagnosis,
    next_command,
    seen_notes,
    whole_answer,
    whole_summary,
)
from cpfls_cli.commands.extend import extended, finish_extended
from cpfls_cli.commands.numbers import why_no_body_found, with_numbers
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.flights.inputs import known_by, numbered_roles
from cpfls_cli.flights.models import learned_by, read_base
from cpfls_cli.flights.recordings import FlightSplit, Recordings, read_flights, refuse_seen, seen_twice, split_flights
from cpfls_cli.gap.naming.results import Diagnosis
from cpfls_cli.gap.whole_vehicle import beside_rotors, has_effects, of_vehicle
from cpfls_cli.pages.disagreement import where
from cpfls_cli.pages.extended import model_with, warnings
from cpfls_cli.pages.first_screen import notes_on_flights
from cpfls_cli.pages.repeats import WHAT_TO_FLY
from cpfls_cli.pages.source import source_of
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.content import Block, Folded, Text
from cpfls_cli.report.outcome import Command, Outcome, as_json

FILES = ("disagreement.h5", "diagnosis.h5", "extended.h5", "report.html", "gap.json")
"""What a folder holds in the end; no extended.h5 where the extension was refused."""


@dataclass(frozen=True)
class _Given:
    """What the workflow starts from."""

    flights: Recordings
    split: FlightSplit
    base: VehicleModel
    learned: tuple[LearnedFlight, ...]
    inputs: Mapping[str, InputFile]

    def inputs_of(self, role: str) -> dict[str, InputFile]:
        """Give the inputs whose role begins so."""
        return {name: file for name, file in self.inputs.items() if name.startswith(role)}


@dataclass(frozen=True)
class _Answers:
    """What it arrives at; `extended` is None where the extension is refused, for the reason."""

    disagreement: DisagreementRecord
    diagnosis: Diagnosis
    diagnosed: DiagnosisRecord
    extended: ExtendedRecord | None
    refused: str


def run(job: Job, flights: Sequence[Path], held_out: Sequence[Path], model: Path | None) -> Outcome:
    """Find where a model and flights disagree, name what is missing, and put it into the model.

    The search adds one effect after another until nothing more can be named, so once through is all the way.
    """
    job = with_numbers(job, "gap", model)
    why = "" if job.found is None else why_no_body_found(job, job.found)
    if why:
        raise InputError(
            f"{job.found}: {why}, so no gap can be measured against it; --accept-guesses takes guesses from mass and "
            f"arms, or fly "
            f"what tells its inertia: {WHAT_TO_FLY}"
        )
    given = _begin(job, flights, held_out, model)
    if job.dry_run:
        line = Text(f"{job.output}: would be filled; the config and all inputs are good")
        return Outcome({"dry_run": True, "output": str(job.output)}, (line,))
    answers = _answers(job, given)
    with filled_folder(job.output, FILES) as folder:
        answers, written = _written(job, given, answers, folder)
        summary = {**whole_summary(answers.diagnosed, answers.diagnosis), "disagreement": answers.disagreement.summary}
        summary["extended"] = {"written": answers.extended is not None, "reason": answers.refused}
        text = json.dumps(as_json(summary), indent=1, allow_nan=False)
        write_text(folder / "gap.json", text + "\n")
        job.progress(0.97, 1, "report")
        # Without a bar of its own: the bar is that of the whole.
        report.run(replace(job, output=folder / "report.html", progress=lambda *_: None), written)
    job.progress(1, 1)
    return Outcome(summary, tuple(_blocks(job, answers)), next=(_next(job, answers, [*flights, *held_out], model),))


def _next(job: Job, answers: _Answers, flights: Sequence[Path], model: Path | None) -> Command:
    folder = job.output
    to_replay: Command = ("cpfls", "replay", job.config, folder / FILES[2], *flights, "-o", job.beside("replay.h5"))
    given = () if model is None else ("--model", model)
    to_answer = go_on(job, "response", *flights, *given, output=job.beside("response.h5"))
    named = to_answer if answers.extended is None else to_replay
    return next_command(job, answers.diagnosed, named, to_answer, folder / FILES[1])


def _begin(job: Job, flights: Sequence[Path], held_out: Sequence[Path], model: Path | None) -> _Given:
    roles = numbered_roles("flight", flights) | numbered_roles("held-out", held_out)
    inputs = take_inputs(job, roles | ({} if model is None else {"model": model}))
    check_folder(job.output, job.force, FILES)
    for name in FILES:
        refuse_inputs(job.output / name, job.inputs)
    check_ignored(job.study)
    # All flights are read together, so that one battery is full in all of them.
    read = read_flights([*flights, *held_out], job.study)
    base = read_base(model, job.study)
    flown = tuple(of_vehicle(read.recordings, base)) if has_effects(base) else read.recordings
    balanced, given = beside_rotors(read.recordings, base), flown[: len(flights)]
    split = split_flights(balanced[: len(flights)], balanced[len(flights) :], job.study.gap)
    # Those held out are behind those learned from, whoever chose them.
    files = [inputs[role] for role in roles]
    refuse_seen(files[: len(split.training)], files[len(split.training) :])
    twice = seen_twice(files)
    learned, judged = learned_by(model), known_by(numbered_roles("flight", flights), inputs)
    whole = with_seen(Recordings(given, (*twice, *read.warnings)), model, learned, judged)
    return _Given(whole, split, base, learned, inputs)


def _answers(job: Job, given: _Given) -> _Answers:
    study, base, split = job.study, given.base, given.split
    disagreement = compared(study, given.flights, base, progress_of(job.progress, 0.0, 0.15), split.whole)
    diagnosis, record = diagnosed(study, split, given.flights.warnings, base, progress_of(job.progress, 0.15, 0.85))
    job.progress(0.85, 1, "extend")
    try:
        extension = extended(study, split.training, split.held_out, record, base)
    except ComputationError as error:
        return _Answers(disagreement, diagnosis, record, None, str(error))
    return _Answers(disagreement, diagnosis, record, extension, "")


def _written(job: Job, given: _Given, answers: _Answers, folder: Path) -> tuple[_Answers, list[Path]]:
    """Write the artifacts, each made from the one before, and give them back with the headers that say so."""
    paths = [folder / name for name in FILES[:3]]
    jobs = [replace(job, output=path) for path in paths]
    compared_with = given.inputs_of("flight") | given.inputs_of("model")
    first = finish_disagreement(jobs[0], answers.disagreement, given.learned, compared_with)
    inputs = {"disagreement": input_file(paths[0]), **given.inputs_of("held-out")}
    second = finish_diagnosis(jobs[1], answers.diagnosed, first, inputs)
    if answers.extended is None:
        return replace(answers, disagreement=first, diagnosed=second), paths[:2]
    third = finish_extended(jobs[2], answers.extended, second, {"diagnosis": input_file(paths[1])})
    return replace(answers, disagreement=first, diagnosed=second, extended=third), paths


def _blocks(job: Job, answers: _Answers) -> Iterator[Block]:
    disagreement = source_of(replace(job, output=job.output / FILES[0]), answers.disagreement)
    diagnosis = source_of(replace(job, output=job.output / FILES[1]), answers.diagnosed)
    yield from seen_notes(answers.diagnosed)
    yield from whole_answer(diagnosis, answers.diagnosis)
    yield Folded("where they disagree", list(where(disagreement)))
    if answers.extended is None:
        yield Text(answers.refused)
    else:
        yield from (Text(warning, "warning") for warning in warnings(answers.extended))
        yield Text(model_with(str(job.output / "extended.h5"), answers.extended))
    yield Text(f"{job.output / 'report.html'}: all of it, with figures")
    yield from notes_on_flights([answers.disagreement])
