"""Stage `compare`: where a model and flights disagree."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from difflib import get_close_matches
from pathlib import Path

from cpfls_cli.artifacts.base_file import base_artifact, base_data, base_model, model_base
from cpfls_cli.artifacts.disagreement_file import disagreement_data
from cpfls_cli.artifacts.extended_file import is_extended, read_extended
from cpfls_cli.artifacts.flights_file import flights_data
from cpfls_cli.artifacts.formats import DISAGREEMENT, EXTENDED
from cpfls_cli.artifacts.job import Job, Progress, begin, finish_data
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.config.study import Study, generator
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import ConfigError
from cpfls_cli.flights.recordings import Flights, read_flights
from cpfls_cli.flights.sources import read_good
from cpfls_cli.gap.compare import Disagreement, compare
from cpfls_cli.gap.extended import ExtendedModel, plain
from cpfls_cli.pages.disagreement_words import disagreement_lines, disagreement_summary
from cpfls_cli.report.outcome import Outcome, nothing_written


def run(job: Job, flights: Sequence[Path], model: Path | None) -> Outcome:
    """Compare a model with flights and write where they disagree.

    Parameters
    ----------
    flights : sequence of Path
        Artifacts, or logs that the config describes.
    model : Path or None
        An identified model, or one with effects; None for the rigid body of the vehicle.
    """
    inputs = begin(job, flight_roles("flight", flights) | ({} if model is None else {"model": model}))
    check_ignored(job.study)
    given = read_flights(flights, job.study)
    own, base = _model(model, job.study)
    if job.dry_run:
        return nothing_written(job)
    found = compared(job.study, given, own, progress_of(job.progress))
    data = {
        **disagreement_data(found, given),
        **base_data(base),
        **flights_data(given.recordings, ["given"] * len(flights)),
    }
    finish_data(job, DISAGREEMENT, data, inputs)
    return Outcome(disagreement_summary(found, given), tuple(disagreement_lines(found, given)), given.warnings)


def _model(path: Path | None, study: Study) -> tuple[ExtendedModel, Artifact | None]:
    """Read a model, with or without effects, and the identified model under it."""
    if path is not None and is_extended(path):
        return read_extended(path, study), base_artifact(read_good(path, EXTENDED))
    base = None if path is None else model_base(path, study)
    return plain(base_model(base, path or Path())), base


def compared(
    study: Study, given: Flights, model: ExtendedModel, progress: Callable[[float, str], None]
) -> Disagreement:
    """Compare a model with flights."""
    return compare(given.recordings, model, study.gap, generator(study, "compare"), progress)


def flight_roles(role: str, flights: Sequence[Path]) -> dict[str, Path]:
    """Give flights the roles of numbered inputs."""
    return {f"{role}-{number}": path for number, path in enumerate(flights, start=1)}


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
