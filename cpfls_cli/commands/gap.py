"""Stage `gap`: compare, diagnose and extend in one go, with a report."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cpfls_cli.artifacts.base_file import base_data, base_model, model_base
from cpfls_cli.artifacts.disagreement_file import disagreement_data
from cpfls_cli.artifacts.flights_file import flights_data
from cpfls_cli.artifacts.formats import DIAGNOSIS, DISAGREEMENT, EXTENDED
from cpfls_cli.artifacts.job import Job, finish_data, input_file, take_inputs
from cpfls_cli.artifacts.output import check_folder, filled_folder, write_text
from cpfls_cli.artifacts.spec import ArtifactSpec, InputFile
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.commands import report
from cpfls_cli.commands.compare import check_ignored, compared, flight_roles, progress_of
from cpfls_cli.commands.diagnose import Answer, answered
from cpfls_cli.commands.extend import Grown, extended, require_named
from cpfls_cli.errors import ComputationError
from cpfls_cli.flights.recordings import Flights, read_flights
from cpfls_cli.flights.split import Split, seen_twice, split_flights
from cpfls_cli.gap.compare import Disagreement
from cpfls_cli.gap.extended import plain as without_effects
from cpfls_cli.pages.disagreement_words import disagreement_summary, where_lines
from cpfls_cli.report.outcome import Outcome, plain

FILES = ("disagreement.h5", "diagnosis.h5", "extended.h5", "report.html", "gap.json")
"""What a folder holds in the end; no extended.h5 where the extension was refused."""


@dataclass(frozen=True)
class _Given:
    """What the workflow starts from."""

    flights: Flights
    split: Split
    base: Artifact | None
    path: Path
    inputs: Mapping[str, InputFile]


@dataclass(frozen=True)
class _Found:
    """What it arrives at; `grown` is None where the extension is refused, for the reason."""

    disagreement: Disagreement
    answer: Answer
    grown: Grown | None
    refused: str


def run(job: Job, flights: Sequence[Path], held_out: Sequence[Path], model: Path | None) -> Outcome:
    """Find where a model and flights disagree, name what is missing, and put it into the model.

    The search adds one effect after another until nothing more can be named, so once through is all the way.

    Parameters
    ----------
    job : Job
        Its output is a folder.
    flights : sequence of Path
        Artifacts, or logs that the config describes.
    held_out : sequence of Path
        Flights to judge on.
    model : Path or None
        An identified model; None for the rigid body of the vehicle.
    """
    given = _begin(job, flights, held_out, model)
    if job.dry_run:
        line = f"{job.output}: would be filled; the config and all inputs are good"
        return Outcome({"dry_run": True, "output": str(job.output)}, (line,))
    found = _find(job, given)
    summary = {**found.answer.summary, "disagreement": disagreement_summary(found.disagreement, given.flights)}
    summary["extended"] = {"written": found.grown is not None, "reason": found.refused}
    with filled_folder(job.output, FILES) as folder:
        written = _write(job, given, found, folder)
        text = json.dumps(plain(summary), indent=1, allow_nan=False)
        write_text(folder / "gap.json", text + "\n")
        job.progress(0.97, 1, "report")
        report.run(replace(job, output=folder / "report.html", progress=_quiet), written)
    job.progress(1, 1)
    lines = (*found.answer.lines, *where_lines(found.disagreement, given.flights), _last_line(job, found))
    warned = () if found.grown is None else tuple(found.grown.warnings)
    return Outcome(
        summary, lines, (*_twice(given), *given.flights.warnings, *found.answer.found.audit.warnings, *warned)
    )


def _begin(job: Job, flights: Sequence[Path], held_out: Sequence[Path], model: Path | None) -> _Given:
    roles = flight_roles("flight", flights) | flight_roles("held-out", held_out)
    inputs = take_inputs(job, roles | ({} if model is None else {"model": model}))
    check_folder(job.output, job.force)
    check_ignored(job.study)
    # All flights are read together, so that one battery is full in all of them.
    read = read_flights([*flights, *held_out], job.study)
    given, held = read.recordings[: len(flights)], read.recordings[len(flights) :]
    split = split_flights(given, held, job.study.gap)
    base = None if model is None else model_base(model, job.study)
    return _Given(Flights(given, read.warnings), split, base, model or Path(), inputs)


def _twice(given: _Given) -> tuple[str, ...]:
    learned, held = (
        [file for role, file in given.inputs.items() if role.startswith(kind)] for kind in ("flight", "held-out")
    )
    return seen_twice(learned, held)


def _find(job: Job, given: _Given) -> _Found:
    study, base = job.study, given.base
    model = without_effects(base_model(base, given.path))
    disagreement = compared(study, given.flights, model, progress_of(job.progress, 0.0, 0.15))
    answer = answered(study, given.split, base, given.path, progress_of(job.progress, 0.15, 0.85))
    job.progress(0.85, 1, "extend")
    try:
        grown, refused = _grown(job, given, answer), ""
    except ComputationError as error:
        grown, refused = None, str(error)
    return _Found(disagreement, answer, grown, refused)


def _grown(job: Job, given: _Given, answer: Answer) -> Grown:
    diagnosis = answer.found.diagnosis
    require_named(diagnosis.verdict, diagnosis.effects)
    split = given.split
    audit = answer.found.audit
    return extended(job.study, split.training, split.held_out, diagnosis.effects, audit, given.base, given.path)


def _write(job: Job, given: _Given, found: _Found, folder: Path) -> list[Path]:
    base, flights = base_data(given.base), given.flights
    stored = flights_data(flights.recordings, ["given"] * len(flights.recordings))
    own = {role: file for role, file in given.inputs.items() if not role.startswith("held-out")}
    held = {role: file for role, file in given.inputs.items() if role.startswith("held-out")}
    data = {**disagreement_data(found.disagreement, flights), **base, **stored}
    first = _artifact(job, folder / "disagreement.h5", DISAGREEMENT, data, own)
    inputs = {"disagreement": input_file(first), **held}
    second = _artifact(job, folder / "diagnosis.h5", DIAGNOSIS, {**found.answer.data, **base}, inputs)
    if found.grown is None:
        return [first, second]
    from_diagnosis = {"diagnosis": input_file(second)}
    third = _artifact(job, folder / "extended.h5", EXTENDED, {**found.grown.data, **base}, from_diagnosis)
    return [first, second, third]


def _artifact(
    job: Job, path: Path, spec: ArtifactSpec, data: Mapping[str, Any], inputs: Mapping[str, InputFile]
) -> Path:
    finish_data(replace(job, output=path), spec, data, inputs)
    return path


def _last_line(job: Job, found: _Found) -> str:
    if found.grown is None:
        return found.refused
    names = ", ".join(effect.name for effect in found.answer.found.diagnosis.effects)
    return f"{job.output / 'extended.h5'}: the model with {names}"


def _quiet(done: float, total: int, note: str = "") -> None:
    """Show nothing: the bar is that of the whole."""
