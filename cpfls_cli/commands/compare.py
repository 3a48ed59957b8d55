"""Command `compare`: where a model and flights disagree."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from cpfls_cli.artifacts.disagreement import DisagreementRecord
from cpfls_cli.artifacts.job import Job, Progress, begin, finish, go_on
from cpfls_cli.artifacts.learned import MODEL_FLIGHT, LearnedFlight, as_inputs
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.commands.numbers import to_fly, why_no_body_found, with_numbers
from cpfls_cli.config.study import Study, generator
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import ConfigError
from cpfls_cli.flights.inputs import known_by, numbered_roles
from cpfls_cli.flights.models import is_found, is_identified, learned_by, read_model
from cpfls_cli.flights.recordings import Recordings, read_flights
from cpfls_cli.gap.compare import compare
from cpfls_cli.gap.whole_vehicle import of_vehicle
from cpfls_cli.pages.disagreement import answer
from cpfls_cli.pages.source import source_of
from cpfls_cli.pages.trust import KnownBy, seen_warnings
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.outcome import Command, Outcome, nothing_written
from cpfls_cli.weak_form.windows import Recording
from cpfls_cli.words import did_you_mean


def run(job: Job, flights: Sequence[Path], model: Path | None) -> Outcome:
    """Compare a model with flights and write where they disagree."""
    roles = numbered_roles("flight", flights)
    inputs = begin(job, roles | ({} if model is None else {"model": model}))
    check_ignored(job.study)
    job = with_numbers(job, "compare", model, whole=model is not None and is_found(model))
    read, learned = read_flights(flights, job.study), learned_by(model)
    base = VehicleModel(vehicle=job.study.vehicle) if model is None else read_model(model, job.study)
    given = replace(read, recordings=tuple(of_vehicle(read.recordings, base)))
    if job.dry_run:
        return nothing_written(job)
    given = with_seen(given, model, learned, known_by(roles, inputs))
    record = compared(job.study, given, base, progress_of(job.progress))
    record = finish_disagreement(job, record, learned, inputs)
    return Outcome(record.summary, tuple(answer(source_of(job, record))), next=(_next(job, record, flights, model),))


def _next(job: Job, record: DisagreementRecord, flights: Sequence[Path], model: Path | None) -> Command:
    if record.audit.contradiction:
        return to_correct(job)
    if not record.gap.above_noise.any():
        return to_fly(job)
    if not record.is_base(job.study.vehicle):
        return to_gap(job, flights, model)
    return go_on(job, "diagnose", job.output, output=job.beside("diagnosis.h5"))


def to_correct(job: Job) -> Command:
    """Give the command that shows how a log is read: something of that is wrong."""
    return "cpfls", "config", job.config, "--section", "import"


def to_gap(job: Job, flights: Sequence[Path], model: Path | None) -> Command:
    """Give the command that names what is missing, from the model on where `cpfls gap` can start from it."""
    if job.found is not None and why_no_body_found(job, job.found):
        return to_fly(job)
    starts = model is not None and (is_found(model) or is_identified(model))
    given: Sequence[str | Path] = ("--model", model) if model is not None and starts else ()
    return go_on(job, "gap", *flights, *given, output=job.beside("gap"))


def with_seen(given: Recordings, model: Path | None, learned: Sequence[LearnedFlight], judged: KnownBy) -> Recordings:
    """Say of flights which of them the model that is held against them learned from."""
    seen = () if model is None else seen_warnings(model.name, learned, judged)
    return replace(given, warnings=(*seen, *given.warnings))


def finish_disagreement(
    job: Job, record: DisagreementRecord, learned: Sequence[LearnedFlight], inputs: Mapping[str, InputFile]
) -> DisagreementRecord:
    """Write a disagreement, with the flights that its model learned from as inputs."""
    of_model, parts = as_inputs(MODEL_FLIGHT, learned)
    return finish(job, replace(record, learned=parts), {**inputs, **of_model})


def compared(
    study: Study,
    given: Recordings,
    model: VehicleModel,
    progress: Callable[[float, str], None],
    whole: Sequence[Recording] = (),
) -> DisagreementRecord:
    """Compare a model with flights; rotors are held against `whole` ones, where there are more than these."""
    disagreement = compare(given.recordings, model, study.gap, generator(study, "compare"), progress, whole=whole)
    return DisagreementRecord.of(disagreement, given.recordings, given.warnings, model)


def check_ignored(study: Study) -> None:
    """Refuse names in `gap.ignore` that no effect has."""
    for name in study.gap.ignore:
        if name not in CATALOGUE:
            hint = did_you_mean(name, CATALOGUE, "`cpfls effects` lists all")
            raise ConfigError(f"gap.ignore = {name}: no such effect ({hint})")


def progress_of(progress: Progress, start: float = 0.0, end: float = 1.0) -> Callable[[float, str], None]:
    """Show a part of the work, from one share of the whole to another, on the progress of a job."""
    return lambda done, note: progress(start + (end - start) * done, 1, note)
