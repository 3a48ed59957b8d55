"""Identify a model from one or more flights and compare it with its baselines."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from signal import SIGINT
from typing import Annotated

import typer

from cpfls_cli.arguments import (
    ChooseOnOption,
    ResumeOption,
    SchedulerOption,
    TimeLimitOption,
    TrainingArgument,
    ValidateOption,
    WorkersOption,
)
from cpfls_cli.artifacts.gate import read_origin
from cpfls_cli.artifacts.identified import IdentifiedModel, identified_model
from cpfls_cli.config.study import generator, settings_of
from cpfls_cli.consistency.findings import contradictions
from cpfls_cli.errors import ComputationError, ConfigError
from cpfls_cli.flights.same_vehicle import other_vehicles
from cpfls_cli.flights.training import (
    SplitFlights,
    check_file,
    choosing_source,
    flight_roles,
    held_out_parts,
    known_flight,
    numbered_roles,
    read_training,
)
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.findings import short_flight, swings
from cpfls_cli.identification.identify import Identification
from cpfls_cli.identification.identify import identify as identified
from cpfls_cli.identification.search import NothingFoundError, SearchRun, SearchStep, require_flights
from cpfls_cli.inertia import six_parameters
from cpfls_cli.pages.identification import WORDS
from cpfls_cli.pages.identified_figures import FIGURES
from cpfls_cli.pages.trust import tell_before_search
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.content import Command, Text
from cpfls_cli.search import Watch, begin_search
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages._checkpoint import stop_note, without_model
from cpfls_cli.validation.trust import Trust
from cpfls_cli.validation.validate import Validation
from cpfls_cli.validation.validate import validate as examine
from cpfls_cli.validation.verdict import contradicted
from cpfls_cli.workers.workforce import WorkerError

SelectionOption = Annotated[
    Path | None,
    typer.Option("--selection", metavar="SELECTION", help="Learn from these samples only (made by `cpfls reduce`)."),
]


@stage(IdentifiedModel, title="Identification", figures=FIGURES, words=WORDS, study=True, resumes=True)
def identify(
    run: Run,
    flights: TrainingArgument,
    selection: SelectionOption = None,
    validate: ValidateOption = None,
    choose_on: ChooseOnOption = None,
    resume: ResumeOption = False,
    time_limit: TimeLimitOption = None,
    workers: WorkersOption = 1,
    scheduler: SchedulerOption = None,
) -> IdentifiedModel | None:
    """Identify a model, and gather the evidence on it."""
    others, choosing = validate or [], choose_on or []
    roles = flight_roles(flights) | ({"selection": selection} if selection else {})
    roles |= numbered_roles("choose-on", choosing) | numbered_roles("validate", others)
    inputs, search = begin_search(run, roles, resume=resume, workers=workers, scheduler=scheduler)
    run.files.update(inputs)
    known = {role: known_flight(path, inputs[role]) for role, path in roles.items()}
    data, kept = read_training(flights, selection, run.study, inputs), choosing_source(choosing, known)
    with settings_of("identification", run.study):
        require_flights(run.study.identification.choice, given=kept is not None)
    held_out = held_out_parts(run.study, data.rests, known, others)
    every = [*flights, *choosing, *others]
    # A simulated flight cannot contradict itself.
    recorded = (path for path in every if "log" in read_origin(path).inputs)
    wrong = contradictions(finding.of(path.name) for path in recorded for finding in check_file(path, run.study))
    for sentence in other_vehicles(every, run.study):
        run.said.append(Text(sentence, "warning", always=True))
    tell_before_search(wrong)
    if run.dry_run:
        return None
    clock, watch = time.perf_counter(), Watch(run, time_limit)
    run.until_written.enter_context(search.checkpoint.kept())
    found = _identified(
        run, flights, data, held_out, kept, search.run(watch, _shown(run), count=workers, scheduler=scheduler)
    )
    if isinstance(found, NothingFoundError):
        search.end(found.stop_reason)
        raise without_model(found.stop_reason, watch.signal) or _of(flights, found)
    found = _with_length(found, flights, data)
    evidence, signal = _evidence(run, found, data, held_out, wrong, watch.signal)
    model = VehicleModel(vehicle=run.study.vehicle, fuzzy=found.model)
    parts = zip(flight_roles(flights), data.parts, strict=True)
    learned = tuple(known[role]._replace(samples=samples, of=of) for role, (samples, of) in parts)
    hashes = tuple(file.sha256 for role, file in inputs.items() if role.startswith("choose-on"))
    made = identified_model(found, run.study.identification.base, data.indices, evidence, model, learned, hashes)
    unjudged = signal is not None and evidence is None and run.study.identification.validation.enabled
    if not unjudged:
        run.afterwards.append(lambda: search.end(found.stop_reason))
    run.also = {**made.errors, "seconds": round(time.perf_counter() - clock, 3)}
    run.next.append(_next(run, made, flights))
    remedy = None if not unjudged else "--resume" if search.checkpoint.path.exists() else "--force"
    note, run.exit_code = stop_note(found.stop_reason, signal, run.output, unjudged=remedy)
    run.said += [note] if note else []
    return made


def _next(run: Run, made: IdentifiedModel, flights: Sequence[Path]) -> Command:
    """Give the command that hands a good model over, or else shows why it is none."""
    if made.trust in (Trust.SIMULATION, Trust.CONTROL, Trust.INSIDE):
        return "cpfls", "export", run.output, "-o", run.output.with_suffix(".c")
    return "cpfls", "report", run.config, *flights, run.output, "-o", run.sibling("report.html")


def _identified(
    job: Run,
    flights: Sequence[Path],
    data: SplitFlights,
    held_out: dict[str, TorqueSource],
    kept: TorqueSource | None,
    search: SearchRun,
) -> Identification | NothingFoundError:
    try:
        with settings_of("identification", job.study):
            return identified(
                data.training,
                data.learned,
                held_out,
                job.study.identification,
                generator(job.study, "identify"),
                search,
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


def _with_length(result: Identification, flights: Sequence[Path], data: SplitFlights) -> Identification:
    """Add a warning of short flights, where all were recorded: a planned one may be exact."""
    if not all("log" in read_origin(path).inputs for path in flights):
        return result
    short = short_flight(swings(data.training), result.system.parameters)
    return result if short is None else replace(result, findings=(*result.findings, short))


def _of(flights: Sequence[Path], error: ComputationError | ConfigError) -> ComputationError | ConfigError:
    kind = ConfigError if isinstance(error, ConfigError) else ComputationError
    return kind(f"{' '.join(str(path) for path in flights)}: {error}")


def _shown(job: Run) -> Callable[[SearchStep], None]:
    """Show the progress of a search on that of its job; a new machine compiles before the first step."""
    job.progress(0.0, 1, "loads compiled loops")
    return lambda step: job.progress(step.generation + step.share, step.generations + 1, _note(step))


def _note(step: SearchStep) -> str:
    generation = f"generation {step.generation} of {step.generations}"
    if step.best is None:
        return generation
    return f"{generation}  best error {step.best[0]:.3g}, max {step.best[1]:.3g} N m, cond {step.best[2]:.4g}"


def _evidence(
    job: Run,
    result: Identification,
    data: SplitFlights,
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
