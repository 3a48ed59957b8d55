"""Command `extend`: the model with the effects that it missed in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from cpfls_cli.artifacts.diagnosis import Diagnosis
from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.artifacts.gap_effects import PlaybackChangeGroup
from cpfls_cli.artifacts.job import Job, begin, finish
from cpfls_cli.artifacts.learned import MODEL_FLIGHT, LearnedFlight, as_inputs, joined_flights, learned_in
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.commands.numbers import with_numbers
from cpfls_cli.config.study import Study
from cpfls_cli.effects.registry import effect
from cpfls_cli.errors import ComputationError
from cpfls_cli.flights.models import learned_by, read_base
from cpfls_cli.flights.same_vehicle import read_result_of_vehicle
from cpfls_cli.gap.before_after import errors_by_horizon, left_out, played_pairs, rates_fade
from cpfls_cli.gap.extended import extend, plain
from cpfls_cli.gap.naming.results import GapVerdict, NamedEffect
from cpfls_cli.gap.recorded import HELD_OUT, TRAINING, in_roles
from cpfls_cli.gap.whole_vehicle import has_effects, on_top_of, require_body, whole_vehicle, with_known_wrench
from cpfls_cli.pages.extended import warnings
from cpfls_cli.pages.model import answer
from cpfls_cli.pages.source import source_of
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.weak_form.windows import Recording

_EXTENDS = (GapVerdict.NAMED, GapVerdict.PARTIAL, GapVerdict.AMBIGUOUS)


def run(job: Job, diagnosis: Path, model: Path | None) -> Outcome:
    """Put the named effects into a model and write it."""
    inputs = begin(job, {"diagnosis": diagnosis} | ({} if model is None else {"model": model}))
    job = with_numbers(job, "extend", model)
    study = job.study
    diagnosed, origin = read_result_of_vehicle(diagnosis, Diagnosis, study)
    base = diagnosed.base if model is None else read_base(model, study)
    named_effects(diagnosed)
    if job.dry_run:
        return nothing_written(job)
    flights = (in_roles(diagnosed.recorded, role) for role in (TRAINING, HELD_OUT))
    training, held = (
        with_known_wrench([each.recording(study.vehicle, study.gap.ground_height_m) for each in own], base)
        for own in flights
    )
    known = learned_in(origin.inputs, diagnosed.learned, MODEL_FLIGHT) if model is None else learned_by(model)
    record = extended(study, training, held, diagnosed, base)
    record, learned = with_learned(record, diagnosed.learned_from(origin.inputs), known)
    record = finish(job, record, {**inputs, **learned})
    summary = {**record.summary, "warnings": warnings(record)}
    to_export = ("cpfls", "export", job.output, "-o", job.output.with_suffix(".c"))
    return Outcome(summary, tuple(answer(source_of(job, record))), next=(to_export,))


def with_learned(
    record: ExtendedRecord, of_effects: Sequence[LearnedFlight], of_base: Sequence[LearnedFlight]
) -> tuple[ExtendedRecord, dict[str, InputFile]]:
    """Take the flights that the effects of a model and its base learned from; they are inputs of its file."""
    flights, parts = as_inputs("flight", joined_flights(of_effects, of_base))
    return replace(record, learned=parts), flights


def named_effects(diagnosis: Diagnosis) -> Sequence[NamedEffect]:
    """Take the effects that a diagnosis names; one that names none, or what is not known here, is refused."""
    effects = diagnosis.effects or diagnosis.closest
    for each in effects:
        effect(each.name)
    require_named(diagnosis.verdict, diagnosis.effects)
    return effects


def require_named(verdict: str, effects: Sequence[NamedEffect]) -> None:
    """Refuse a diagnosis that names no effect to add."""
    if verdict not in _EXTENDS or not effects:
        closest = " (those that it calls closest are not it)" if verdict == GapVerdict.UNEXPLAINED else ""
        raise ComputationError(
            f"not extended: the diagnosis is {verdict} and names no effect that could be added{closest}"
        )


def extended(
    study: Study,
    training: Sequence[Recording],
    held: Sequence[Recording],
    diagnosis: Diagnosis,
    base: VehicleModel,
) -> ExtendedRecord:
    """Put the effects that a diagnosis names into a model; refused where the held-out gap does not shrink."""
    gusty_floor = diagnosis.gap.floor if diagnosis.gusts else None
    named = named_effects(diagnosis), diagnosis.audit
    extension = extend(training, held, *named, study.gap, base.fuzzy, gusty_floor)
    stated = base.vehicle if has_effects(base) else study.vehicle
    whole, given = (on_top_of(base, whole_vehicle(each, stated)) for each in (extension.model, plain(base.fuzzy)))
    if diagnosis.air is not None and diagnosis.gusts:
        whole = replace(whole, gusts=diagnosis.air.gusts)
    require_body(extension.model, stated)
    played = played_pairs(held, whole, given, rates_fade(training, study.gap.horizon_s))
    playback = PlaybackChangeGroup.of_pairs(played, errors_by_horizon(played, study.gap.horizon_s))
    missing = left_out(whole, whole.beside_table, held, study.gap.horizon_s)
    return ExtendedRecord.of(extension, stated, whole, playback, missing)
