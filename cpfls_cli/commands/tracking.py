"""Stage `simulate` in mode computed-torque: attitude control by an identified model, beside other controllers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cpfls_cli.artifacts.base_file import model_base
from cpfls_cli.artifacts.extended_file import is_extended
from cpfls_cli.artifacts.formats import FLIGHT, TRAJECTORY
from cpfls_cli.artifacts.job import Job, begin, finish_data
from cpfls_cli.artifacts.model_file import read_model
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.artifacts.tracking_file import logged_signals, tracking_data
from cpfls_cli.commands.tracking_setup import controllers_of, loop_of, planned_torque
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.control import Plan, flown_signals, plan_of, scores, start_of, track
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.flights.sources import read_with
from cpfls_cli.pages.flown import noise_record
from cpfls_cli.pages.tracking_words import tracking_outcome
from cpfls_cli.pages.trust import trust_notes
from cpfls_cli.report.outcome import Outcome, nothing_written

_TURNED = ("attitude", "attitude_rate", "attitude_acceleration")


def run(job: Job, trajectory: Path, model: Path) -> Outcome:
    """Follow the attitude of a trajectory with several controllers, and write the flight under the model's.

    Parameters
    ----------
    model : Path
        Identified.

    Raises
    ------
    InputError
        If the model has effects, or is of another vehicle.
    ConfigError
        If the control rate is lower than that of the trajectory, or the vehicle is lost before it starts.
    ComputationError
        If the planned pitch comes near the vertical.
    """
    inputs = begin(job, {"trajectory": trajectory, "model": model})
    artifact = _identified(model, job.study)
    identified = read_model(artifact, model)
    plan = _plan(trajectory, job.study)
    if job.dry_run:
        return nothing_written(job)
    settings, vehicle = job.study.simulation.computed_torque, job.study.vehicle
    rng = generator(job.study, "simulate")
    controllers = controllers_of(plan, identified, artifact.array("baselines/rigid_body"), vehicle)
    loop = loop_of(plan, settings, identified, vehicle, rng)
    error = np.array(settings.initial_error_rad)
    tracked = track(plan, controllers, loop, error, planned_torque(plan, vehicle), job.progress)
    names = [controller.name for controller in controllers]
    exact = flown_signals(plan, tracked, names.index("model"), loop.plant)
    record = tracking_data(plan, names, scores(plan, tracked, loop.gains.settling_time), identified, exact["attitude"])
    signals, noise = logged_signals(exact, job.study, rng)
    finish_data(job, FLIGHT, {**signals, **noise_record(noise), **record}, inputs)
    notes = trust_notes(artifact, model)
    return tracking_outcome(signals, sorted(noise), record, notes, identified.same_everywhere)


def _identified(path: Path, study: Study) -> Artifact:
    if is_extended(path):
        raise InputError(
            f"{path}: a model with effects is flown in closed loop only; add --mode closed-loop, or give a model that "
            "`cpfls identify` made"
        )
    return model_base(path, study)


def _plan(trajectory: Path, study: Study) -> Plan:
    source = read_with(trajectory, TRAJECTORY, "time", *_TURNED)
    planned = {name: source.array(name) for name in _TURNED}
    with settings_of("simulation", study):
        settings = study.simulation.computed_torque
        try:
            plan = plan_of(source.array("time"), planned, settings.control_rate_hz)
            start_of(plan, np.array(settings.initial_error_rad))
            return plan
        except ComputationError as error:
            raise ComputationError(f"{trajectory}: {error}") from None
