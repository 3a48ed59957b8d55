"""Stage `predict`: torque, inertia and Coriolis matrices of a stored model along a flight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.artifacts.extended_file import is_extended
from cpfls_cli.artifacts.formats import FLIGHT, MODEL, PREDICTION
from cpfls_cli.artifacts.job import Job, begin, finish_data
from cpfls_cli.artifacts.model_file import read_model
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.artifacts.validation_file import read_draws
from cpfls_cli.commands.predict_extended import extended_prediction
from cpfls_cli.dynamics.rigid_body import not_positive_definite, vertical
from cpfls_cli.flights.flight_source import MOTION, flight_motion
from cpfls_cli.flights.same_vehicle import other_vehicles
from cpfls_cli.flights.sources import read_good, read_with
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.judge import score
from cpfls_cli.identification.model import Model
from cpfls_cli.pages.trust import trust_notes
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.validation.bands import inertia_band, torque_band
from cpfls_cli.validation.bootstrap import Draws

_NO_TRUST = "do not trust the model there"
_WELL_CONDITIONED = 100.0


def run(job: Job, model: Path, flight: Path) -> Outcome:
    """Predict along a flight and write it."""
    inputs = begin(job, {"model": model, "flight": flight})
    if is_extended(model):
        data = extended_prediction(model, flight, job.study)
        if job.dry_run:
            return nothing_written(job)
        finish_data(job, PREDICTION, data, inputs)
        return _outcome(data)
    artifact = read_good(model, MODEL)
    identified = read_model(artifact, model)
    source = read_with(flight, FLIGHT, "time", *MOTION)
    if job.dry_run:
        return nothing_written(job)
    data = _predict(identified, source, read_draws(artifact))
    finish_data(job, PREDICTION, data, inputs)
    outcome = _outcome(data, _trust_outside(identified, artifact))
    notes = (*trust_notes(artifact, model), *other_vehicles([flight], job.study))
    return replace(outcome, warnings=(*notes, *outcome.warnings))


def _predict(model: Model, flight: Artifact, draws: Draws | None) -> dict[str, Any]:
    motion = flight_motion(flight)
    torque = model.torque(motion)
    data = {
        "time": flight.array("time"),
        "attitude": motion.attitude,
        "torque": torque,
        "body_torque": rotations.body_torque(motion.attitude, torque),
        "inertia": model.inertia(motion.attitude).value,
        "coriolis": model.coriolis(motion.attitude, motion.rate),
        "outside": model.outside(motion.attitude).astype(np.uint8),
    }
    if draws is not None:
        data["inertia_low"], data["inertia_high"] = inertia_band(model, draws, motion.attitude)
        data["torque_low"], data["torque_high"] = torque_band(model, draws, motion)
    if "torque" in flight.data:
        data |= {"measured_torque": flight.array("torque"), "error": flight.array("torque") - torque}
    return data


def _trust_outside(model: Model, artifact: Artifact) -> str:
    """Say what the model is worth at attitudes that training did not visit."""
    rank, parameters, condition = (artifact.number(f"solve/{n}") for n in ("rank", "parameters", "condition_number"))
    if model.same_everywhere and rank == parameters and condition <= _WELL_CONDITIONED:
        return f"the same coefficients hold there, if the structure does, and all are known (condition {condition:.3g})"
    return _NO_TRUST


def _outcome(data: dict[str, Any], trust_outside: str = _NO_TRUST) -> Outcome:
    samples, outside = len(data["time"]), int(np.sum(data["outside"]))
    indefinite = int(np.sum(not_positive_definite(data["inertia"], data["attitude"])))
    summary: dict[str, Any] = {"samples": samples, "mse": None, "relative_error": None, "outside": outside}
    summary["not_positive_definite"] = indefinite
    lines = [f"{samples} samples, {outside} outside the region that the training data visited"]
    warnings = []
    if outside:
        visited = f"{outside} of {samples} samples lie outside the attitudes that training visited"
        warnings.append(f"{visited}: {trust_outside}")
    if indefinite:
        warnings.append(f"D(q) is not positive definite at {indefinite} of {samples} samples: no body moves like that")
    if "error" in data:
        # A score looks at attitude and torque only.
        attitude = data["attitude"]
        motion = Motion(attitude, np.zeros_like(attitude), np.zeros_like(attitude))
        measured = TorqueData(data["time"], motion, data["measured_torque"])
        judged = score(measured, data["torque"])
        summary |= {"mse": float(np.mean(judged.mse)), "relative_error": judged.worst_relative_error}
        summary |= {"r2": judged.r2.tolist(), "r2_body": judged.r2_body.tolist()}
        lines.append(f"MSE {summary['mse']:.4g} (N m)^2, relative error {judged.worst_relative_error:.3%} (worst axis)")
        r2, left_out = " ".join(f"{value:.4f}" for value in judged.r2_body), int(np.sum(vertical(attitude)))
        without = f" (without {left_out} samples near a vertical pitch)" if left_out else ""
        lines.append(f"R2 of body torque, roll pitch yaw: {r2}{without}")
    return Outcome(summary, tuple(lines), tuple(warnings))
