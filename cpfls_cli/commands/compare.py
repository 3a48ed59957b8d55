"""Command `compare`: where a model and flights disagree."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path

from cpfls_cli.artifacts.disagreement import DisagreementRecord
from cpfls_cli.artifacts.job import Job, Progress, begin, finish
from cpfls_cli.artifacts.store import holds
from cpfls_cli.artifacts.vehicle_model import VehicleRecord
from cpfls_cli.config.study import Study, generator
from cpfls_cli.config.unknown import require_known
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import ConfigError
from cpfls_cli.flights.inputs import numbered_roles
from cpfls_cli.flights.models import read_model
from cpfls_cli.flights.recordings import Flights, read_flights
from cpfls_cli.gap.compare import compare
from cpfls_cli.gap.whole_vehicle import of_vehicle
from cpfls_cli.pages.disagreement import answer
from cpfls_cli.pages.source import source_of
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.outcome import Outcome, nothing_written


def run(job: Job, flights: Sequence[Path], model: Path | None) -> Outcome:
    """Compare a model with flights and write where they disagree.

    Parameters
    ----------
    flights : sequence of Path
        Artifacts, or logs that the config describes.
    model : Path or None
        Identified, with effects, or of a whole vehicle; None for the rigid body of the vehicle.
    """
    inputs = begin(job, numbered_roles("flight", flights) | ({} if model is None else {"model": model}))
    check_ignored(job.study)
    require_known(job.study, "compare", whole=model is not None and holds(model, VehicleRecord))
    given, base = _with_model(read_flights(flights, job.study), model, job.study)
    if job.dry_run:
        return nothing_written(job)
    record = finish(job, compared(job.study, given, base, progress_of(job.progress)), inputs)
    return Outcome(record.summary, tuple(answer(source_of(job, record))))


def _with_model(given: Flights, path: Path | None, study: Study) -> tuple[Flights, VehicleModel]:
    """Read a model; flights become those of its vehicle."""
    model = VehicleModel(vehicle=study.vehicle) if path is None else read_model(path, study)
    recordings = tuple(of_vehicle(given.recordings, model))
    return replace(given, recordings=recordings), model


def compared(
    study: Study, given: Flights, model: VehicleModel, progress: Callable[[float, str], None]
) -> DisagreementRecord:
    """Compare a model with flights.

    Parameters
    ----------
    model : VehicleModel
        Flights are those of its vehicle.
    """
    disagreement = compare(given.recordings, model, study.gap, generator(study, "compare"), progress)
    return DisagreementRecord.of(disagreement, given.recordings, given.warnings, model)


def check_ignored(study: Study) -> None:
    """Refuse names in `gap.ignore` that no effect has.

    Raises
    ------
    ConfigError
    """
    for name in study.gap.ignore:
        if name not in CATALOGUE:
            near = get_close_matches(name, CATALOGUE, n=1, cutoff=0.4)
            hint = f"did you mean {near[0]}?" if near else "`cpfls effects` lists all"
            raise ConfigError(f"gap.ignore = {name}: no such effect ({hint})")


def progress_of(progress: Progress, start: float = 0.0, end: float = 1.0) -> Callable[[float, str], None]:
    """Show a part of the work on the progress of a job.

    Parameters
    ----------
    start, end : float
        Shares of the whole.

    Returns
    -------
    callable
        Takes the share of the part that is done and a note.
    """
    return lambda done, note: progress(start + (end - start) * done, 1, note)
