"""Prediction of a model with effects: the torque that the rotors have to give for a measured motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.extended_file import read_extended
from cpfls_cli.config.study import Study
from cpfls_cli.dynamics.equations_of_motion import InertiaModel, coriolis_matrix
from cpfls_cli.dynamics.rigid_body import inertia_matrix, inertia_matrix_gradient
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.flights.recordings import read_flights
from cpfls_cli.gap.extended import ExtendedModel
from cpfls_cli.identification.model import Model
from cpfls_cli.regressor.regressor import InertiaValues


def extended_prediction(model: Path, flight: Path, study: Study) -> dict[str, Any]:
    """Predict the rotors' torque along a flight, so that what is measured less that is the gap that remains.

    Returns
    -------
    dict of str to array
        Datasets of a prediction.

    Raises
    ------
    InputError
        If the flight lacks the attitude or a signal that an effect needs.
    """
    extended = read_extended(model, study)
    logged = read_flights([flight], study).recordings[0].signals
    if logged.attitude is None or logged.torque is None:
        raise InputError(f"{flight}: lacks the attitude; a prediction is in Euler coordinates")
    signals = extended.repaired(logged)
    return _data(extended, signals, logged.attitude, logged.torque)


def _data(model: ExtendedModel, signals: Signals, attitude: Array, measured: Array) -> dict[str, Any]:
    body_torque = model.rotor_torque(signals)
    torque = rotations.generalised_torque(attitude, body_torque)
    reference = rotations.generalised_torque(attitude, measured)
    values = _inertia(model.inertia(signals), attitude)
    rate = rotations.attitude_rate(attitude, signals.body_rate)
    return {
        "time": signals.time,
        "attitude": attitude,
        "torque": torque,
        "body_torque": body_torque,
        "measured_torque": reference,
        "error": reference - torque,
        "inertia": values.value,
        "coriolis": coriolis_matrix(values, rate),
        "outside": _outside(model.base, attitude).astype(np.uint8),
    }


def _inertia(inertia: Array | InertiaModel, attitude: Array) -> InertiaValues:
    if isinstance(inertia, np.ndarray):
        return InertiaValues(inertia_matrix(attitude, inertia), inertia_matrix_gradient(attitude, inertia))
    return inertia.inertia(attitude)


def _outside(base: InertiaModel | None, attitude: Array) -> Array:
    return np.asarray(base.outside(attitude) if isinstance(base, Model) else np.zeros(len(attitude)), dtype=float)
