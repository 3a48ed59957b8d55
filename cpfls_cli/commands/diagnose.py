"""Stage `diagnose`: which physical effect a model misses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpfls_cli.artifacts.base_file import base_artifact, base_data, base_model
from cpfls_cli.artifacts.diagnosis_file import diagnosis_data
from cpfls_cli.artifacts.flights_file import flights_data, flights_of
from cpfls_cli.artifacts.formats import DIAGNOSIS, DISAGREEMENT, EXTENDED
from cpfls_cli.artifacts.job import Job, begin, finish_data
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.commands.compare import check_ignored, flight_roles, progress_of
from cpfls_cli.config.study import Study, generator
from cpfls_cli.errors import InputError
from cpfls_cli.flights.recordings import read_flights
from cpfls_cli.flights.same_vehicle import require_vehicle_of
from cpfls_cli.flights.sources import read_good
from cpfls_cli.flights.split import Split, seen_twice, split_flights
from cpfls_cli.gap.before_after import BeforeAfter, before_after
from cpfls_cli.gap.diagnose import DiagnosisRun, diagnose
from cpfls_cli.gap.extended import ExtendedModel
from cpfls_cli.pages.diagnosis_words import diagnosis_lines, diagnosis_summary
from cpfls_cli.report.outcome import Outcome, nothing_written


@dataclass(frozen=True)
class Answer:
    """A diagnosis with all that shows it."""

    found: DiagnosisRun
    shown: BeforeAfter
    model: ExtendedModel
    split: Split

    @property
    def data(self) -> dict[str, Any]:
        """Datasets, with the flights."""
        flights = (*self.split.training, *self.split.held_out)
        roles = ["training"] * len(self.split.training) + ["held-out"] * len(self.split.held_out)
        own = diagnosis_data(self.found, self.shown, self.model, self.split)
        return {**own, **flights_data(flights, roles)}

    @property
    def lines(self) -> tuple[str, ...]:
        """The answer for people."""
        return tuple(diagnosis_lines(self.found, self.shown, self.split.sentence))

    @property
    def summary(self) -> dict[str, Any]:
        """The answer for machines."""
        return diagnosis_summary(self.found, self.shown, self.split.sentence)


def run(job: Job, disagreement: Path, held_out: Sequence[Path]) -> Outcome:
    """Name what a model misses and write it.

    Parameters
    ----------
    disagreement : Path
        Holds the flights and the model.
    held_out : sequence of Path
        Flights to judge on.
    """
    inputs = begin(job, {"disagreement": disagreement} | flight_roles("held-out", held_out))
    check_ignored(job.study)
    source = read_good(disagreement, DISAGREEMENT)
    require_vehicle_of(disagreement, source, job.study)
    if any(file.format == EXTENDED.format for file in source.header.inputs.values()):
        raise InputError(
            f"{disagreement}: was made with a model that has effects already; `cpfls diagnose` names what a base model "
            "misses, so compare without --model, or with an identified model"
        )
    held = read_flights(held_out, job.study)
    split = split_flights(flights_of(source, job.study), held.recordings, job.study.gap)
    base = base_artifact(source)
    if job.dry_run:
        return nothing_written(job)
    answer = answered(job.study, split, base, disagreement, progress_of(job.progress))
    finish_data(job, DIAGNOSIS, {**answer.data, **base_data(base)}, inputs)
    warnings = (*source.texts("warning"), *held.warnings)
    learned = [file for role, file in source.header.inputs.items() if role.startswith("flight")]
    twice = seen_twice(learned, [file for role, file in inputs.items() if role.startswith("held-out")])
    return Outcome(answer.summary, answer.lines, (*twice, *warnings, *answer.found.audit.warnings))


def answered(
    study: Study, split: Split, base: Artifact | None, path: Path, progress: Callable[[float, str], None]
) -> Answer:
    """Diagnose flights.

    Parameters
    ----------
    base : Artifact or None
        The identified model; None for the rigid body of the vehicle.
    path : Path
        For messages.
    """
    model = base_model(base, path)
    rng = generator(study, "diagnose")
    found = diagnose(split.training, split.held_out, study.gap, rng, model=model, progress=progress)
    extended = found.model(model)
    return Answer(found, before_after(split.held_out, found.held_out, extended, study.gap), extended, split)
