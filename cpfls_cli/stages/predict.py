"""Stage `predict`: torque, inertia and Coriolis matrices of a stored model along a flight."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.artifacts.formats import FLIGHT, MODEL, PREDICTION
from cpfls_cli.artifacts.records import Artifact
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.judge import score
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.physics import not_positive_definite
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.stages.extended_file import is_extended
from cpfls_cli.stages.flight_source import MOTION, flight_motion
from cpfls_cli.stages.job import Job, Outcome, begin, finish
from cpfls_cli.stages.model_file import read_model
from cpfls_cli.stages.predict_extended import extended_prediction
from cpfls_cli.stages.sources import read_good, read_with


def run(job: Job, model: Path, flight: Path) -> Outcome:
    """Predict along a flight and write it.

    Parameters
    ----------
    job : Job
    model : Path
    flight : Path

    Returns
    -------
    Outcome
    """
    started = begin(job, {"model": model, "flight": flight})
    if is_extended(model):
        data = extended_prediction(model, flight, job.study)
        if started.dry_run is not None:
            return started.dry_run
        finish(job, PREDICTION, data, started.inputs)
        return _outcome(data)
    identified = read_model(read_good(model, MODEL), model)
    source = read_with(flight, FLIGHT, "time", *MOTION)
    if started.dry_run is not None:
        return started.dry_run
    data = _predict(identified, source)
    finish(job, PREDICTION, data, started.inputs)
    return _outcome(data)


def _predict(model: Model, flight: Artifact) -> dict[str, Any]:
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
    if "torque" in flight.data:
        data |= {"measured_torque": flight.array("torque"), "error": flight.array("torque") - torque}
    return data


def _outcome(data: dict[str, Any]) -> Outcome:
    samples, outside = len(data["time"]), int(np.sum(data["outside"]))
    indefinite = int(np.sum(not_positive_definite(data["inertia"])))
    summary: dict[str, Any] = {"samples": samples, "mse": None, "relative_error": None, "outside": outside}
    summary["not_positive_definite"] = indefinite
    lines = [f"{samples} samples, {outside} outside the region that the training data visited"]
    warnings = []
    if outside:
        warnings.append(f"{outside} of {samples} samples are extrapolated: do not trust the model there")
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
        lines.append("R2 of body torque, roll pitch yaw: " + " ".join(f"{value:.4f}" for value in judged.r2_body))
    return Outcome(summary, tuple(lines), tuple(warnings))
