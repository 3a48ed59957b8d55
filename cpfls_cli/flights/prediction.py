"""Predict torque, inertia and Coriolis matrices of a model along a flight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.config.study import Study
from cpfls_cli.config.unknown import require_known
from cpfls_cli.consistency.findings import contradictions
from cpfls_cli.dynamics import (
    InertiaFunctions,
    coriolis_matrix,
    inertia_matrix,
    inertia_matrix_gradient,
    not_positive_definite,
    vertical,
)
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.results import MOTION, Flight
from cpfls_cli.flights.models import any_model, is_found, read_model
from cpfls_cli.flights.recordings import read_alone
from cpfls_cli.flights.same_vehicle import model_of_another, other_vehicles
from cpfls_cli.flights.training import check_file, require_signals, torque_source_of
from cpfls_cli.gap.balance.weak_flight import rotation_balance, translation_balance
from cpfls_cli.gap.whole_vehicle import of_vehicle
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.findings import Score, ScoreSums
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.regressor.regressor import InertiaValues, Motion
from cpfls_cli.rotations import attitude_rate, body_torque, generalised_torque
from cpfls_cli.store import read
from cpfls_cli.validation.bands import Draws, inertia_band, torque_band
from cpfls_cli.validation.trust import Trust

_UNJUDGED = "has no verdict and no bands; `cpfls identify` with identification.validation.enabled adds them"


@dataclass(frozen=True, kw_only=True)
class AlongFlight:
    """Torque, inertia matrix and Coriolis matrix of a model along a flight.

    Attributes
    ----------
    time : array, shape (time,), s
        From the first sample.
    attitude : array, shape (time, 3), rad
        Roll, pitch, yaw of the flight.
    torque : array, shape (time, 3), N m
        Generalised torque of the model, on the Euler angles.
    body_torque : array, shape (time, 3), N m, body frame
        Torque of the model.
    measured_torque : array, shape (time, 3), N m, or None
        Generalised torque that the model is compared with: of the flight; of a whole vehicle without a logged torque,
        what its motion takes. None where the flight holds none.
    inertia : array, shape (time, 3, 3), kg m^2
        D(q), on the Euler angles.
    coriolis : array, shape (time, 3, 3), kg m^2/s
        C(q, qd) by Christoffel symbols.
    extrapolates : array of bool, shape (time,)
        Where the attitude lies outside the region that training visited.
    inertia_band, torque_band : tuple of (array, array), or None
        Ends of 95 % bands, of an identified model that holds the evidence for them.
    force, measured_force : array, shape (time, 3), N, body frame, or None
        Of a whole vehicle, without weight: of the model, and what the motion takes.
    """

    time: Array
    attitude: Array
    torque: Array
    body_torque: Array
    measured_torque: Array | None
    inertia: Array
    coriolis: Array
    extrapolates: BoolArray
    inertia_band: tuple[Array, Array] | None = None
    torque_band: tuple[Array, Array] | None = None
    force: Array | None = None
    measured_force: Array | None = None

    @classmethod
    def of(
        cls, model: InertiaFunctions, time: Array, motion: Motion, measured: Array | None, draws: Draws | None
    ) -> AlongFlight:
        """Predict along a flight, whose generalised torque, shape (time, 3), N m, is None where it holds none."""
        torque, inertia = model.torque(motion), model.inertia(motion.attitude)
        return cls(
            time=time,
            attitude=motion.attitude,
            torque=torque,
            body_torque=body_torque(motion.attitude, torque),
            measured_torque=measured,
            inertia=inertia.value,
            coriolis=coriolis_matrix(inertia, motion.rate),
            extrapolates=model.outside(motion.attitude),
            inertia_band=None if draws is None else inertia_band(model, draws, motion.attitude, inertia.value),
            torque_band=None if draws is None else torque_band(model, draws, motion, torque),
        )

    @property
    def error(self) -> Array | None:
        """Measured minus model torque, shape (time, 3), N m; None where nothing was measured."""
        return None if self.measured_torque is None else self.measured_torque - self.torque

    @cached_property
    def score(self) -> Score | None:
        """Errors by axis, of body torque without samples near a vertical pitch; None where nothing was measured."""
        if self.measured_torque is None:
            return None
        sums, nothing = ScoreSums(), np.zeros_like(self.attitude)
        # A score looks at attitude and torque only.
        sums.add(TorqueData(self.time, Motion(self.attitude, nothing, nothing), self.measured_torque), self.torque)
        return sums.score()

    @property
    def body_torque_rms(self) -> Array | None:
        """Root mean square error of body torque by axis, N m, without samples near a vertical pitch."""
        error, known = self.error, ~vertical(self.attitude)
        return None if error is None else _rms(body_torque(self.attitude[known], error[known]))

    @property
    def force_rms(self) -> Array | None:
        """Root mean square error of the force by axis, N; None where there is none to compare with."""
        if self.force is None or self.measured_force is None:
            return None
        return _rms(self.measured_force - self.force)


def along_flight(model: Path, flight: Path, study: Study) -> tuple[AlongFlight, tuple[str, ...]]:
    """Predict along a flight, and say what speaks against model and flight.

    InputError if the flight lacks the attitude or a signal that the model needs.
    """
    require_known(study, "predict", whole=is_found(model))
    record = any_model(model)
    if not isinstance(record, IdentifiedModel):
        return _of_vehicle(model, flight, study)
    wrong = contradictions(check_file(flight, study))
    flown, _ = read(flight, Flight)
    require_signals(flight, flown.signals, "time", *MOTION)
    motion = Motion(*(flown.signals[name] for name in MOTION))
    found = AlongFlight.of(record.functions, flown.time, motion, flown.torque, record.uncertainty)
    unjudged = [f"{model.name}: {_UNJUDGED}"] if record.trust == Trust.NOT_JUDGED else []
    others = (*model_of_another(model, study), *other_vehicles([flight], study))
    return found, (*wrong, *unjudged, *others, *_beyond(record, found, flight.name))


def _beyond(model: IdentifiedModel, found: AlongFlight, flight: str) -> Iterator[str]:
    """Warn of attitudes that training did not visit, and of an inertia that no body has."""
    outside, samples = int(np.sum(found.extrapolates)), len(found.time)
    if outside:
        condition = f"{model.condition_number:.3g}"
        holds = (
            "the same coefficients hold there, if the structure does: one rule holds everywhere and all its "
            f"coefficients are known (condition number {condition})"
            if model.known_everywhere
            else "do not trust it there, the model extrapolates"
        )
        which = f"{outside} of {samples} samples lie outside the attitudes that training visited"
        yield f"{flight}: {which}: {holds}"
    if wrong := int(np.sum(not_positive_definite(found.inertia, found.attitude))):
        yield f"{flight}: D(q) is not positive definite at {wrong} of {samples} samples: no body moves like that"


def _of_vehicle(path: Path, flight: Path, study: Study) -> tuple[AlongFlight, tuple[str, ...]]:
    """Predict torque and force on a whole vehicle, compared with a logged torque or with what the motion takes."""
    model, alone = read_model(path, study), read_alone(flight, study)
    (given,) = of_vehicle([alone.signals], model)
    if given.attitude is None:
        raise InputError(f"{flight}: lacks the attitude; a prediction is in Euler coordinates")
    signals = model.acting(model.repaired(given))
    wrench = model.wrench_along(signals)
    if torque_source_of(flight, study) == "column" and "body_torque" in alone.flight.signals:
        first = int(np.searchsorted(alone.flight.signals["time"], signals.time[0]))
        measured = alone.flight.signals["body_torque"][first : first + len(signals)]
    else:
        measured = rotation_balance(signals, model.fuzzy).along(signals.time)
    found = replace(
        _prediction(signals, model, wrench[:, :3], measured),
        force=wrench[:, 3:],
        measured_force=translation_balance(signals).along(signals.time) if signals.has_force else None,
    )
    return found, (*alone.contradictions, *(f"{flight.name}: {each}" for each in alone.warnings))


def _prediction(signals: Signals, model: VehicleModel, torque: Array, measured: Array) -> AlongFlight:
    """Arrange torques along a flight with attitude, shape (time, 3) each, N m, body frame."""
    attitude = signals.attitude
    assert attitude is not None, "checked before"
    euler, given = (generalised_torque(attitude, each) for each in (torque, measured))
    inertia = _inertia_values(model, attitude)
    return AlongFlight(
        time=signals.time,
        attitude=attitude,
        torque=euler,
        body_torque=torque,
        measured_torque=given,
        inertia=inertia.value,
        coriolis=coriolis_matrix(inertia, attitude_rate(attitude, signals.body_rate)),
        extrapolates=np.zeros(len(attitude), dtype=bool) if model.fuzzy is None else model.fuzzy.outside(attitude),
    )


def _inertia_values(model: VehicleModel, attitude: Array) -> InertiaValues:
    if model.fuzzy is not None:
        return model.fuzzy.inertia(attitude)
    tensor = model.body.inertia
    return InertiaValues(inertia_matrix(attitude, tensor), inertia_matrix_gradient(attitude, tensor))


def _rms(values: Array) -> Array:
    root: Array = np.sqrt(np.mean(values**2, axis=0))
    return root
