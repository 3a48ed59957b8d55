"""Command `predict`: torque, inertia and Coriolis matrices of a stored model along a flight."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.flight import CLOCK, ClockGroup, FlightRecord
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.job import Job, Progress, begin, finish_parts
from cpfls_cli.artifacts.prediction import Findings, PredictionRecord
from cpfls_cli.artifacts.spec import PART
from cpfls_cli.artifacts.store import count_rows, read_number
from cpfls_cli.commands.numbers import with_numbers
from cpfls_cli.config.study import Study
from cpfls_cli.consistency.findings import contradictions
from cpfls_cli.dynamics.equations_of_motion import coriolis_matrix
from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
from cpfls_cli.dynamics.rigid_body import inertia_matrix, inertia_matrix_gradient
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.flights.flight_source import (
    FlightStretch,
    FlightStretches,
    check_file,
    flight_source,
    flight_stretches,
    torque_source_of,
)
from cpfls_cli.flights.inputs import hashes_of
from cpfls_cli.flights.models import any_model, is_found, read_model
from cpfls_cli.flights.same_vehicle import model_of_another, other_vehicles
from cpfls_cli.gap.balance.weak_flight import rotation_balance, translation_balance
from cpfls_cli.gap.whole_vehicle import of_vehicle
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.pages.identification import unjudged
from cpfls_cli.pages.prediction import answer
from cpfls_cli.pages.sensors import contradicted
from cpfls_cli.pages.trust import NOT_SEEN, seen_words
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.regressor.regressor import InertiaValues
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.validation.bootstrap import Draws
from cpfls_cli.weak_form.windows import Recording

_Predicted = Callable[[FlightStretch], PredictionRecord]


def run(job: Job, model: Path, flight: Path) -> Outcome:
    """Predict along a flight and write it."""
    inputs = begin(job, {"model": model, "flight": flight})
    job = with_numbers(job, "predict", model, whole=is_found(model))
    record = any_model(model)
    identified = record if isinstance(record, IdentifiedModel) else None
    findings, wrong = Findings(), contradictions(check_file(flight, job.study, driven=identified is None))
    seen = seen_words(record, hashes_of(flight, inputs["flight"]))
    said = [Text(contradicted(each), "warning") for each in wrong]
    said += [] if seen == NOT_SEEN else [Text(f"{model.name} along {flight.name}: {seen}")]
    if identified is None:
        predicted, stretches = _of_vehicle(model, flight, job.study), flight_stretches(flight, job.study)
        if job.dry_run:
            predicted(next(iter(stretches)))
            return nothing_written(job)
        parts = _by_stretches(predicted, stretches, findings, job.progress)
        finish_parts(job, _on_clock(parts, stretches.begins), len(stretches), inputs)
        about = (Text(f"{stretches.name}: {warning}", "warning") for warning in stretches.warnings)
        return Outcome(findings.summary | {"contradictions": list(wrong)}, (*said, *about, *answer(findings)))
    functions = identified.functions
    torque = count_rows(flight, FlightRecord.spec(), FlightRecord.path("torque")) is not None
    flown = flight_source(flight, torque=torque)
    if job.dry_run:
        return nothing_written(job)
    parts = _along(functions, identified.uncertainty, flown, torque, findings, job.progress)
    finish_parts(job, _on_clock(parts, read_number(flight, CLOCK)), len(flown), inputs)
    others = (*model_of_another(model, job.study), *other_vehicles([flight], job.study))
    notes = (*unjudged(identified, model), *(Text(note, "warning") for note in others))
    return Outcome(findings.summary | {"contradictions": list(wrong)}, (*said, *notes, *answer(findings, identified)))


def _on_clock(parts: Iterator[PredictionRecord], begins: float) -> Iterator[PredictionRecord]:
    """Keep the stamp of the log's own clock at time 0, s."""
    clock = ClockGroup.of(begins)
    return (replace(part, clock=clock) for part in parts)


def _along(
    model: InertiaFunctions,
    draws: Draws | None,
    flown: TorqueSource,
    torque: bool,
    findings: Findings,
    progress: Progress,
) -> Iterator[PredictionRecord]:
    """Predict part by part, and take note of what is found."""
    for data in flown.chunks():
        for some in (data[start : start + PART] for start in range(0, len(data), PART)):
            part = PredictionRecord.of(model, some.time, some.motion, some.torque if torque else None, draws)
            findings.add(part)
            progress(findings.samples, len(flown))
            yield part


def _by_stretches(
    predicted: _Predicted, stretches: FlightStretches, findings: Findings, progress: Progress
) -> Iterator[PredictionRecord]:
    """Predict stretch by stretch, and take note of what is found."""
    for stretch in stretches:
        own = predicted(stretch).part(stretch.own)
        for start in range(0, len(own.time), PART):
            part = own.part(slice(start, start + PART))
            findings.add(part)
            progress(findings.samples, len(stretches))
            yield part


def _of_vehicle(path: Path, flight: Path, study: Study) -> _Predicted:
    """Predict torque and force on a whole vehicle; they are held against what the motion takes.

    A torque that was logged beside the rotor speeds is taken in its place. A stretch raises an InputError if the flight
    lacks the attitude or a signal that the model needs.
    """
    model, told = read_model(path, study), torque_source_of(flight, study) == "column"

    def predicted(stretch: FlightStretch) -> PredictionRecord:
        (recording,) = of_vehicle([Recording(flight.name, stretch.signals)], model)
        if recording.signals.attitude is None:
            raise InputError(f"{flight}: lacks the attitude; a prediction is in Euler coordinates")
        signals = model.acting(model.repaired(recording.signals))
        wrench = model.wrench_along(signals)
        recorded = stretch.known.get("body_torque") if told else None
        against = rotation_balance(signals, model.fuzzy).along(signals.time) if recorded is None else recorded
        return replace(
            _prediction(signals, model, wrench[:, :3], against),
            held_against="motion" if recorded is None else "recorded",
            force=wrench[:, 3:],
            measured_force=translation_balance(signals).along(signals.time) if signals.has_force else None,
        )

    return predicted


def _prediction(signals: Signals, model: VehicleModel, body_torque: Array, measured: Array) -> PredictionRecord:
    """Arrange torques along a flight with attitude, shape (time, 3) each, N m, body frame."""
    attitude = signals.attitude
    assert attitude is not None, "checked before"
    torque, given = (rotations.generalised_torque(attitude, each) for each in (body_torque, measured))
    inertia = _inertia(model, attitude)
    return PredictionRecord(
        time=signals.time,
        attitude=attitude,
        torque=torque,
        body_torque=body_torque,
        measured_torque=given,
        error=given - torque,
        inertia=inertia.value,
        coriolis=coriolis_matrix(inertia, rotations.attitude_rate(attitude, signals.body_rate)),
        outside=np.zeros(len(attitude), dtype=bool) if model.fuzzy is None else model.fuzzy.outside(attitude),
    )


def _inertia(model: VehicleModel, attitude: Array) -> InertiaValues:
    if model.fuzzy is not None:
        return model.fuzzy.inertia(attitude)
    tensor = model.body.inertia
    return InertiaValues(inertia_matrix(attitude, tensor), inertia_matrix_gradient(attitude, tensor))
