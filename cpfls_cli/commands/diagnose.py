"""Command `diagnose`: which physical effect a model misses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from cpfls_cli.artifacts.diagnosis import DiagnosisRecord
from cpfls_cli.artifacts.disagreement import DisagreementRecord
from cpfls_cli.artifacts.gap_effects import effect_summary, estimate_summary
from cpfls_cli.artifacts.job import Job, begin, finish, go_on
from cpfls_cli.artifacts.learned import MODEL_FLIGHT, as_inputs
from cpfls_cli.artifacts.rebuilt import vehicle_model
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.commands.compare import check_ignored, progress_of, to_correct
from cpfls_cli.commands.numbers import to_fly
from cpfls_cli.config.study import Study, generator
from cpfls_cli.errors import InputError
from cpfls_cli.flights.inputs import numbered_roles
from cpfls_cli.flights.recordings import FlightSplit, read_flights, refuse_seen, seen_twice, split_flights
from cpfls_cli.flights.same_vehicle import read_of_vehicle
from cpfls_cli.gap.before_after import before_after
from cpfls_cli.gap.diagnose import diagnose
from cpfls_cli.gap.naming.results import Diagnosis, GapVerdict
from cpfls_cli.gap.whole_vehicle import known_already
from cpfls_cli.pages.diagnosis import answer
from cpfls_cli.pages.effects import closest_sentence
from cpfls_cli.pages.first_screen import next_steps, notes_on_flights, verdict_box
from cpfls_cli.pages.source import Source, source_of
from cpfls_cli.pages.trust import seen_warnings
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.content import Block, Text
from cpfls_cli.report.outcome import Command, Outcome, nothing_written


def run(job: Job, disagreement: Path, held_out: Sequence[Path]) -> Outcome:
    """Name what a model misses and write it."""
    inputs = begin(job, {"disagreement": disagreement} | numbered_roles("held-out", held_out))
    check_ignored(job.study)
    compared = read_of_vehicle(disagreement, DisagreementRecord, job.study)
    if not compared.is_base(job.study.vehicle):
        raise InputError(
            f"{disagreement}: was made with a model that has effects already; `cpfls diagnose` names what a base model "
            "misses, so compare without --model, or with an identified model"
        )
    learned = [file for role, file in compared.origin.inputs.items() if role.startswith("flight")]
    refuse_seen(learned, (inputs[role] for role in numbered_roles("held-out", held_out)))
    held = read_flights(held_out, job.study)
    split = split_flights(compared.flights.recordings(job.study), held.recordings, job.study.gap)
    if job.dry_run:
        return nothing_written(job)
    warnings = (*compared.warning, *held.warnings)
    progress = progress_of(job.progress)
    diagnosis, record = diagnosed(job.study, split, warnings, vehicle_model(compared.base), progress)
    record = finish_diagnosis(job, record, compared, inputs)
    answered = whole_answer(source_of(job, record), diagnosis)
    notes: list[Block] = [*seen_notes(record), *notes_on_flights([record])]
    to_extend = go_on(job, "extend", job.output, output=job.beside("extended.h5"))
    to_report = ("cpfls", "report", job.config, disagreement, job.output, "-o", job.beside("report.html"))
    followed = next_command(job, record, to_extend, to_report, job.output)
    return Outcome(whole_summary(record, diagnosis), (*answered, *notes), next=(followed,))


def next_command(
    job: Job,
    record: DiagnosisRecord,
    named: Command,
    unnamed: Command,
    diagnosis: Path,
) -> Command:
    """Give the command that goes on by the verdict.

    Parameters
    ----------
    named, unnamed : Command
        For a gap with a name, and for one without.
    diagnosis : Path
        Where the verdict is written.
    """
    if record.contradiction:
        return to_correct(job)
    match record.verdict:
        case GapVerdict.NAMED | GapVerdict.PARTIAL:
            return named
        case GapVerdict.AMBIGUOUS:
            return go_on(job, "trajectory", "--for", diagnosis, output=job.beside("path.h5"))
        case GapVerdict.NO_GAP | GapVerdict.NOT_EXCITED:
            return to_fly(job)
    return unnamed


def finish_diagnosis(
    job: Job, record: DiagnosisRecord, compared: DisagreementRecord, inputs: Mapping[str, InputFile]
) -> DiagnosisRecord:
    """Write a diagnosis, with the flights of the disagreement and those that its model learned from as inputs."""
    flights = {role: file for role, file in compared.origin.inputs.items() if role.startswith("flight")}
    of_model, parts = as_inputs(MODEL_FLIGHT, compared.model_learned_from)
    return finish(job, replace(record, learned=parts), {**inputs, **flights, **of_model})


def seen_notes(record: DiagnosisRecord) -> Iterator[Text]:
    """Warn of flights that stand for two, and of those held out that the effects or their model were found in."""
    inputs = record.origin.inputs
    held_out = [file for role, file in inputs.items() if role.startswith("held-out")]
    twice = seen_twice(file for role, file in inputs.items() if role.startswith("flight"))
    model = inputs["disagreement"].name
    hashes = [(file.name, (file.sha256,)) for file in held_out]
    seen = seen_warnings(f"the model of {model}", record.model_learned_from, hashes)
    return (Text(note, "warning", always=True) for note in (*twice, *seen))


def diagnosed(
    study: Study,
    split: FlightSplit,
    warnings: Sequence[str],
    base: VehicleModel,
    progress: Callable[[float, str], None],
) -> tuple[Diagnosis, DiagnosisRecord]:
    """Diagnose flights; of a base with effects of its own, those that come on top."""
    model, settings = base.fuzzy, replace(study.gap, ignore=(*study.gap.ignore, *known_already(base)))
    rng = generator(study, "diagnose")
    parts = split.training, split.held_out
    result = diagnose(*parts, settings, rng, whole=split.whole, model=model, progress=progress)
    extended = result.model(model)
    change = before_after(split.training, split.held_out, result.held_out, extended, settings, base)
    flights = (split.training, split.held_out, split.sentence)
    record = DiagnosisRecord.of(result, change, extended, *flights, warnings, base)
    return result.diagnosis, record


def whole_summary(record: DiagnosisRecord, diagnosis: Diagnosis) -> dict[str, Any]:
    """Give the summary of a diagnosis with what its artifact has no place for.

    That is: what to do next, the closest effects where faults of sensors are named, and the possible range of the
    vehicle's numbers.
    """
    return record.summary | {
        "headline": verdict_box(record).title,
        "next": next_steps(record),
        "closest": [effect_summary(effect) for effect in diagnosis.closest],
        "parameters": {name: estimate_summary(number) for name, number in diagnosis.parameters.items()},
    }


def whole_answer(source: Source[DiagnosisRecord], diagnosis: Diagnosis) -> Iterator[Block]:
    """Give the answer with the closest effects where the artifact has no place for them."""
    yield from answer(source)
    if not source.record.effects.closest:
        yield from (Text(closest_sentence(effect)) for effect in diagnosis.closest)
