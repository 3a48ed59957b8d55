"""Command `identify`: find a model in flights and judge it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from signal import SIGINT

from cpfls_cli.artifacts.identified import IdentifiedRecord
from cpfls_cli.artifacts.job import Job, finish
from cpfls_cli.artifacts.learned import LearnedGroup
from cpfls_cli.artifacts.store import read_header
from cpfls_cli.commands.stopped import stopped, without_model
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.consistency.findings import contradictions
from cpfls_cli.errors import ComputationError, ConfigError
from cpfls_cli.flights.flight_source import check_file
from cpfls_cli.flights.inputs import choosing_source, held_out_parts, input_roles
from cpfls_cli.flights.same_vehicle import other_vehicles
from cpfls_cli.flights.training import TrainingData, flight_roles, read_training
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.excitation import swings
from cpfls_cli.identification.findings import short_flight
from cpfls_cli.identification.identify import Identification, identify
from cpfls_cli.identification.search import NothingFoundError, SearchRun, SearchStep, require_flights
from cpfls_cli.inertia import six_parameters
from cpfls_cli.pages.model import answer
from cpfls_cli.pages.sensors import tell_before_search
from cpfls_cli.pages.source import source_of
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Command, Outcome, nothing_written
from cpfls_cli.search.resumable import SearchOptions, Watch, begin_search
from cpfls_cli.validation.trust import Trust
from cpfls_cli.validation.validate import Validation
from cpfls_cli.validation.validate import validate as examine
from cpfls_cli.validation.verdict import contradicted
from cpfls_cli.workers.workforce import WorkerError


def run(
    job: Job,
    flights: Sequence[Path],
    selection: Path | None,
    validate: Sequence[Path],
    options: SearchOptions,
    choose_on: Sequence[Path] = (),
) -> Outcome:
    """Identify a model and write it."""
    inputs, search = begin_search(job, input_roles(flights, selection, validate, choose_on), options)
    data = read_training(flights, selection, job.study, inputs)
    kept = choosing_source(choose_on, inputs)
    with settings_of("identification", job.study):
        require_flights(job.study.identification.choice, given=kept is not None)
    held_out = held_out_parts(job.study, data.rests, inputs, validate)
    wrong = _contradictions([*flights, *choose_on, *validate], job.study)
    others = other_vehicles([*flights, *choose_on, *validate], job.study)
    tell_before_search(wrong)
    if job.dry_run:
        return nothing_written(job)
    clock = time.perf_counter()
    watch = Watch(job, options.time_limit_s)
    with search.kept():
        result = _identify(job, flights, data, held_out, kept, search.run(options, watch, _shown(job)))
    if isinstance(result, NothingFoundError):
        search.end(result.stop_reason)
        raise without_model(result.stop_reason, watch.signal) or _of(flights, result)
    result = _with_length(result, flights, data)
    with search.kept():
        evidence, signal = _evidence(job, result, data, held_out, wrong, watch.signal)
        base, vehicle = job.study.identification.base, VehicleModel(vehicle=job.study.vehicle, fuzzy=result.model)
        parts = LearnedGroup.parts(flight_roles(flights), data.parts)
        record = finish(job, IdentifiedRecord.of(result, base, data.indices, evidence, vehicle, parts), inputs)
    unjudged = signal is not None and evidence is None and job.study.identification.validation.enabled
    if not unjudged:
        search.end(result.stop_reason)
    seconds = round(time.perf_counter() - clock, 3)
    summary = {**record.summary, "not_positive_definite": result.indefinite, "seconds": seconds}
    warnings = [Text(sentence, "warning") for sentence in others]
    outcome = Outcome(summary, (*warnings, *answer(source_of(job, record))), next=(_next(job, record, flights),))
    remedy = "--resume" if search.checkpoint.path.exists() else "--force"
    return stopped(outcome, result.stop_reason, signal, job.output, unjudged=remedy if unjudged else None)


def _next(job: Job, record: IdentifiedRecord, flights: Sequence[Path]) -> Command:
    """Give the command that hands a good model over, or else shows why it is none."""
    if record.trust in (Trust.SIMULATION, Trust.CONTROL, Trust.INSIDE):
        return "cpfls", "export", job.output, "-o", job.output.with_suffix(".c")
    return "cpfls", "report", job.config, *flights, job.output, "-o", job.beside("report.html")


def _contradictions(flights: Sequence[Path], study: Study) -> tuple[str, ...]:
    """Say what of recorded flights contradicts itself; a simulated one cannot."""
    recorded = (path for path in flights if "log" in read_header(path).inputs)
    return contradictions(finding.of(path.name) for path in recorded for finding in check_file(path, study))


def _identify(
    job: Job,
    flights: Sequence[Path],
    data: TrainingData,
    held_out: dict[str, TorqueSource],
    kept: TorqueSource | None,
    run: SearchRun,
) -> Identification | NothingFoundError:
    try:
        with settings_of("identification", job.study):
            return identify(
                data.training,
                data.learned,
                held_out,
                job.study.identification,
                generator(job.study, "identify"),
                run,
                six_parameters(job.study.vehicle.inertia_kg_m2),
                kept,
            )
    except NothingFoundError as error:
        return error
    except WorkerError:
        # Says where it evaluated; nothing is wrong with the flights.
        raise
    except (ComputationError, ConfigError) as error:
        raise _of(flights, error) from None


def _with_length(result: Identification, flights: Sequence[Path], data: TrainingData) -> Identification:
    """Add a warning of short flights, where all were recorded: a planned one may be exact."""
    if not all("log" in read_header(path).inputs for path in flights):
        return result
    short = short_flight(swings(data.training), result.system.parameters)
    return result if short is None else replace(result, findings=(*result.findings, short))


def _of(flights: Sequence[Path], error: ComputationError | ConfigError) -> ComputationError | ConfigError:
    kind = ConfigError if isinstance(error, ConfigError) else ComputationError
    return kind(f"{' '.join(str(path) for path in flights)}: {error}")


def _shown(job: Job) -> Callable[[SearchStep], None]:
    """Show the progress of a search on that of its job; a new machine compiles before the first step."""
    job.progress(0.0, 1, "loads compiled loops")
    return lambda step: job.progress(step.generation + step.share, step.generations + 1, _note(step))


def _note(step: SearchStep) -> str:
    generation = f"generation {step.generation} of {step.generations}"
    if step.best is None:
        return generation
    return f"{generation}  best error {step.best[0]:.3g}, max {step.best[1]:.3g} N m, cond {step.best[2]:.4g}"


def _evidence(
    job: Job,
    result: Identification,
    data: TrainingData,
    held_out: Mapping[str, TorqueSource],
    wrong: Sequence[str],
    signal: int | None,
) -> tuple[Validation | None, int | None]:
    """Gather the evidence on a model, none if disabled or interrupted, and the number of the signal that came."""
    settings = job.study.identification
    if not settings.validation.enabled or signal is not None:
        return None, signal
    rng, total = generator(job.study, "validate"), settings.generations + 1
    try:
        with settings_of("identification", job.study):
            tell = partial(job.progress, total, total)
            evidence = examine(data.training, data.learned, held_out, settings, result, rng, tell)
            return replace(evidence, verdict=contradicted(evidence.verdict, wrong)), None
    except KeyboardInterrupt as interrupt:
        return None, next(iter(interrupt.args), SIGINT)
