"""Stage `identify`: find a model in a flight and judge it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.formats import MODEL
from cpfls_cli.artifacts.job import Job, finish_data
from cpfls_cli.artifacts.model_file import model_data
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.artifacts.validation_file import validation_data
from cpfls_cli.commands.stopped import stopped, without_model
from cpfls_cli.commands.validating import gather_evidence, verdict_lines, verdict_summary, without_evidence
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.errors import ComputationError, ConfigError, InputError
from cpfls_cli.flights.choosing import choosing_roles, choosing_source
from cpfls_cli.flights.flight_source import flight_source
from cpfls_cli.flights.same_vehicle import other_vehicles
from cpfls_cli.flights.training import TrainingData, flight_roles, read_training
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.identify import TRAINING, Identification, identify
from cpfls_cli.identification.judge import Score
from cpfls_cli.identification.search import NothingFoundError, SearchRun, SearchStep, require_flights
from cpfls_cli.inertia import INERTIA_PARAMETERS, six_parameters
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.search.resumable import SearchOptions, Watch, begin_search
from cpfls_cli.validation.verdict import Verdict
from cpfls_cli.workers.workforce import WorkerError


def run(
    job: Job,
    flights: Sequence[Path],
    selection: Path | None,
    validate: Sequence[Path],
    options: SearchOptions,
    choose_on: Sequence[Path] = (),
) -> Outcome:
    """Identify a model and write it.

    Parameters
    ----------
    selection : Path or None
        Samples to learn from; all of the training part if None.
    validate : sequence of Path
        Other flights to judge the model on; nothing is learned from them.
    options : SearchOptions
        How the search is run.
    choose_on : sequence of Path
        Other flights to choose the model on, for `identification.choice: held-out`.
    """
    inputs, search = begin_search(job, input_roles(flights, selection, validate, choose_on), options)
    data = read_training(flights, selection, job.study, inputs)
    kept = choosing_source(choose_on, inputs)
    with settings_of("identification", job.study):
        require_flights(job.study.identification.choice, given=kept is not None)
    held_out = held_out_parts(job.study, data.rests, inputs, validate)
    others = other_vehicles([*flights, *choose_on, *validate], job.study)
    if job.dry_run:
        return nothing_written(job)
    clock = time.perf_counter()
    watch = Watch(job, options.time_limit_s)
    with search.kept():
        result = _identify(job, flights, data, held_out, kept, search.run(options, watch, _shown(job)))
    if isinstance(result, NothingFoundError):
        search.end(result.stop_reason)
        raise without_model(result.stop_reason, watch.signal) or _of(flights, result)
    with search.kept():
        gathered = gather_evidence(job, result, data, held_out)
        model = model_data(result, job.study.identification.base, data.indices)
        evidence = gathered.evidence
        finish_data(job, MODEL, model | (validation_data(evidence) if evidence else {}), inputs)
    search.end(result.stop_reason)
    verdict = evidence.verdict if evidence else None
    outcome = _outcome(job, result, verdict, len(data.learned), time.perf_counter() - clock, others)
    outcome = without_evidence(outcome, gathered, job.output)
    return stopped(outcome, result.stop_reason, watch.signal, job.output)


def input_roles(
    flights: Sequence[Path], selection: Path | None, validate: Sequence[Path], choose_on: Sequence[Path] = ()
) -> dict[str, Path]:
    """Give the inputs of an identification their roles.

    Parameters
    ----------
    flights : sequence of Path
        That train.
    validate : sequence of Path
        That judge.
    choose_on : sequence of Path
        That the model is chosen on.
    """
    roles = flight_roles(flights) | ({"selection": selection} if selection else {}) | choosing_roles(choose_on)
    return roles | {f"validate-{number}": path for number, path in enumerate(validate, start=1)}


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
    except ComputationError as error:
        raise _of(flights, error) from None


def _of(flights: Sequence[Path], error: ComputationError) -> ComputationError:
    return ComputationError(f"{' '.join(str(path) for path in flights)}: {error}")


def held_out_parts(
    study: Study, rests: Mapping[str, TorqueSource], inputs: Mapping[str, InputFile], validate: Sequence[Path]
) -> dict[str, TorqueSource]:
    """Gather what is judged but not learned from, under names of their own.

    Parameters
    ----------
    rests : mapping of str to TorqueSource
        What of the flights that train is held out.
    inputs : mapping of str to InputFile
        By role, see `input_roles`.
    validate : sequence of Path
        Other flights.

    Raises
    ------
    ConfigError
        If a part was to be held out, and nothing is left for it.
    InputError
        If one of the flights trains too.
    """
    if study.identification.training_share < 1 and not rests:
        raise ConfigError(
            f"identification.embargo_s = {study.identification.embargo_s:g}: leaves nothing of the flight to be "
            "held out; lower it, or lower identification.training_share"
        )
    parts = dict(rests)
    learned = {file.sha256 for role, file in inputs.items() if role.startswith("flight")}
    for number, path in enumerate(validate, start=1):
        if inputs[f"validate-{number}"].sha256 in learned:
            raise InputError(f"--validate {path}: is the flight that trains; validate on another one")
        parts[_free_name(path.name, {TRAINING, *parts})] = flight_source(path)
    return parts


def _free_name(name: str, taken: set[str]) -> str:
    numbered = (f"{name} ({number})" for number in count(2))
    return next(candidate for candidate in chain([name], numbered) if candidate not in taken)


def _shown(job: Job) -> Callable[[SearchStep], None]:
    """Show the progress of a search on that of its job; a new machine needs half a minute before the first step."""
    job.progress(0.0, 1, "loads compiled loops; at the first use on a machine compiles them")
    return lambda step: job.progress(step.generation + step.share, step.generations + 1, _note(step))


def _note(step: SearchStep) -> str:
    generation = f"generation {step.generation} of {step.generations}"
    if step.best is None:
        return generation
    return f"{generation}  best error {step.best[0]:.3g}, max {step.best[1]:.3g} N m, cond {step.best[2]:.4g}"


def _outcome(
    job: Job,
    result: Identification,
    verdict: Verdict | None,
    learned: int,
    seconds: float,
    others: tuple[str, ...],
) -> Outcome:
    training = result.scores["training"]
    held_out = {part: scores for part, scores in result.scores.items() if part != "training"}
    baselines = [name for name in training if name != "model"]
    summary = {
        **_score_summary(training["model"]),
        "condition_number": result.system.condition_number,
        "rank": result.system.rank,
        "parameters": result.system.parameters,
        "generations": len(result.history.evaluations) - 1,
        "evaluations": int(result.history.evaluations[-1]),
        "stop_reason": result.stop_reason,
        "complete": result.complete,
        "front": len(result.front.objectives),
        "choice_error": None if result.front.held_out is None else float(np.min(result.front.held_out)),
        "samples": result.samples["training"],
        "learned": learned,
        "ridge_weight": result.fit.ridge_weight,
        "fuzzy_part": "off" if np.isinf(result.fit.ridge_weight) else "on",
        "inertia_kg_m2": {
            "found": dict(zip(INERTIA_PARAMETERS, result.rigid_body.tolist(), strict=True)),
            "stated": dict(
                zip(INERTIA_PARAMETERS, six_parameters(job.study.vehicle.inertia_kg_m2).tolist(), strict=True)
            ),
        },
        "not_positive_definite": result.indefinite,
        "baselines": {name: _score_summary(training[name]) for name in baselines},
        "held_out": {
            part: {
                **_score_summary(scores["model"]),
                "samples": result.samples[part],
                "outside": result.outside[part],
                "baselines": {name: _score_summary(scores[name]) for name in baselines},
            }
            for part, scores in held_out.items()
        },
        "findings": list(result.findings),
        "verdict": verdict_summary(verdict),
        "seconds": round(seconds, 3),
    }
    stall = job.study.identification.stall_generations
    lines = [*_lines(result, learned, stall), *verdict_lines(verdict)]
    return Outcome(summary, tuple(lines), (*others, *result.findings))


def _score_summary(score: Score) -> dict[str, Any]:
    return {
        "mse": float(np.mean(score.mse)),
        "max_error": float(np.max(score.max_error)),
        "relative_error": score.worst_relative_error,
        "mse_by_axis": [float(value) for value in score.mse],
        "r2": [float(value) for value in score.r2],
        "r2_body": [float(value) for value in score.r2_body],
    }


def _ending(result: Identification, stall: int | None) -> list[str]:
    """Say of a search that ended before its last generation why; one that was stopped has a note of its own."""
    if result.stop_reason != "converged":
        return []
    generation = len(result.history.evaluations) - 1
    return [
        f"converged after generation {generation}: no objective improved enough "
        f"(identification.stall_generations = {stall})"
    ]


def _lines(result: Identification, learned: int, stall: int | None) -> list[str]:
    system = result.system
    lines = [
        f"{system.parameters} parameters from {learned} samples; rank {system.rank}, "
        f"condition number {system.condition_number:.5g}; {result.history.evaluations[-1]} evaluations",
        *_ending(result, stall),
    ]
    if result.front.held_out is not None:
        members = len(result.front.held_out)
        lines.append(
            f"chosen among {members} on the flights kept for it, mean squared error {np.min(result.front.held_out):.3g}"
        )
    moments = " ".join(f"{name} {value:.4g}" for name, value in zip(INERTIA_PARAMETERS, result.rigid_body, strict=True))
    lines.append(f"rigid body that fits best, kg m^2: {moments}")
    width = max(len(part) for part in result.scores)
    for part, scores in result.scores.items():
        for name, score in scores.items():
            r2 = " ".join(f"{value:8.4f}" for value in score.r2_body)
            errors = f"MSE {np.mean(score.mse):9.3g}  largest error {np.max(score.max_error):9.3g} N m"
            relative = f"relative {score.worst_relative_error:8.3%}"
            lines.append(f"{part:{width}}  {name:16}  {errors}  {relative}  body R2 roll pitch yaw {r2}")
    return lines
