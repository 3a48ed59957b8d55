"""Command `predict`: torque, inertia and Coriolis matrices of a stored model along a flight."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.artifacts.flight import MOTION, FlightRecord
from cpfls_cli.artifacts.job import Job, begin, finish
from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.prediction import PredictionRecord
from cpfls_cli.artifacts.store import holds, read_record
from cpfls_cli.config.study import Study
from cpfls_cli.dynamics.equations_of_motion import InertiaModel, coriolis_matrix
from cpfls_cli.dynamics.rigid_body import inertia_matrix, inertia_matrix_gradient
from cpfls_cli.errors import InputError
from cpfls_cli.flights.recordings import read_flights
from cpfls_cli.flights.same_vehicle import other_vehicles, read_of_vehicle
from cpfls_cli.identification.model import Model
from cpfls_cli.pages.model import trust_notes
from cpfls_cli.pages.prediction import answer
from cpfls_cli.pages.source import source_of
from cpfls_cli.regressor.regressor import InertiaValues
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Outcome, nothing_written


def run(job: Job, model: Path, flight: Path) -> Outcome:
    """Predict along a flight and write it.

    Parameters
    ----------
    model : Path
        Identified, or one with effects.
    """
    inputs = begin(job, {"model": model, "flight": flight})
    if holds(model, ExtendedRecord):
        prediction = _with_effects(model, flight, job.study)
        if job.dry_run:
            return nothing_written(job)
        record = finish(job, prediction, inputs)
        return Outcome(record.summary, tuple(answer(source_of(job, record))))
    identified = read_record(model, ModelRecord)
    rebuilt = identified.rebuilt(model)
    flown = read_record(flight, FlightRecord, "time", *MOTION)
    if job.dry_run:
        return nothing_written(job)
    prediction = PredictionRecord.of(rebuilt, flown.time, flown.motion, flown.torque, identified.draws())
    record = finish(job, prediction, inputs)
    notes = (*trust_notes(identified, model), *(Text(n, "warning") for n in other_vehicles([flight], job.study)))
    return Outcome(record.summary, (*notes, *answer(source_of(job, record), identified)))


def _with_effects(path: Path, flight: Path, study: Study) -> PredictionRecord:
    """Predict the rotors' torque of a model with effects: what is measured less that is the gap that remains.

    Raises
    ------
    InputError
        If the flight lacks the attitude or a signal that an effect needs.
    """
    model = read_of_vehicle(path, ExtendedRecord, study).rebuilt(path)
    logged = read_flights([flight], study).recordings[0].signals
    if logged.attitude is None or logged.torque is None:
        raise InputError(f"{flight}: lacks the attitude; a prediction is in Euler coordinates")
    signals, attitude = model.repaired(logged), logged.attitude
    body_torque = model.rotor_torque(signals)
    torque = rotations.generalised_torque(attitude, body_torque)
    measured = rotations.generalised_torque(attitude, logged.torque)
    inertia = _inertia(model.inertia(signals), attitude)
    return PredictionRecord(
        time=signals.time,
        attitude=attitude,
        torque=torque,
        body_torque=body_torque,
        measured_torque=measured,
        error=measured - torque,
        inertia=inertia.value,
        coriolis=coriolis_matrix(inertia, rotations.attitude_rate(attitude, signals.body_rate)),
        outside=model.base.outside(attitude) if isinstance(model.base, Model) else np.zeros(len(attitude), dtype=bool),
    )


def _inertia(inertia: Array | InertiaModel, attitude: Array) -> InertiaValues:
    if isinstance(inertia, np.ndarray):
        return InertiaValues(inertia_matrix(attitude, inertia), inertia_matrix_gradient(attitude, inertia))
    return inertia.inertia(attitude)
