"""Command `simulate` in mode computed-torque: attitude control by an identified model, beside other controllers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.flight import MOTION, FlightRecord, TrackingGroup
from cpfls_cli.artifacts.identified import IdentifiedRecord
from cpfls_cli.artifacts.job import Job, begin, finish
from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.store import holds, read_record
from cpfls_cli.artifacts.trajectory import TrajectoryRecord
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.control.controllers import (
    Controller,
    Plan,
    TorqueActuators,
    computed_torque,
    gains,
    plan_of,
    proportional_derivative,
)
from cpfls_cli.control.track import AttitudeLoop, Sensing, flown_signals, scores, start_of, track
from cpfls_cli.dynamics.equations_of_motion import InertiaModel, RigidBody, TorqueModel, turning_law
from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
from cpfls_cli.dynamics.rigid_body import body_torque, inertia_matrix, inertia_tensor
from cpfls_cli.errors import ComputationError, InputError, about
from cpfls_cli.flights.models import rebuilt
from cpfls_cli.flights.same_vehicle import read_of_vehicle
from cpfls_cli.inertia import six_parameters, symmetric
from cpfls_cli.pages.identification import unjudged
from cpfls_cli.pages.source import source_of
from cpfls_cli.pages.tracking import answer
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.simulation.measured import noisy
from cpfls_cli.simulation.settings import ComputedTorqueSettings
from cpfls_cli.vehicle.rotors import rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings


def run(job: Job, trajectory: Path, model: Path) -> Outcome:
    """Follow the attitude of a trajectory with several controllers, and write the flight under the model's."""
    inputs = begin(job, {"trajectory": trajectory, "model": model})
    identified = _identified(model, job.study)
    functions = rebuilt(model, identified).fuzzy
    assert isinstance(functions, InertiaFunctions), "what is identified"
    plan = _plan(trajectory, job.study)
    if job.dry_run:
        return nothing_written(job)
    settings, vehicle = job.study.simulation.computed_torque, job.study.vehicle
    rng = generator(job.study, "simulate")
    controllers = _controllers(plan, functions, identified.baselines.rigid_body, vehicle)
    loop = _loop(plan, settings, functions, vehicle, rng)
    error = np.array(settings.initial_error_rad)
    tracked = track(plan, controllers, loop, error, _planned_torque(plan, vehicle), job.progress)
    names = [controller.name for controller in controllers]
    exact = flown_signals(plan, tracked, names.index("model"), loop.plant)
    tracking_scores = scores(plan, tracked, loop.gains.settling_time)
    comparison = TrackingGroup.of(plan, names, tracking_scores, functions, exact["attitude"])
    signals, noise = _logged(exact, job.study, rng)
    record = finish(job, FlightRecord.of_simulation(signals, noise, tracking=comparison), inputs)
    summary = {"samples": len(record.time), "noise": sorted(noise), **record.summary}
    blocks = (*unjudged(identified, model), *answer(source_of(job, record), identified))
    to_report = ("cpfls", "report", job.config, model, job.output, "-o", job.beside("report.html"))
    return Outcome(summary, blocks, next=(to_report,))


def _identified(path: Path, study: Study) -> IdentifiedRecord:
    if holds(path, ModelRecord) and not holds(path, IdentifiedRecord):
        raise InputError(
            f"{path}: a model with effects is flown in closed loop only; add --mode closed-loop, or give a model that "
            "`cpfls identify` made"
        )
    return read_of_vehicle(path, IdentifiedRecord, study)


def _plan(trajectory: Path, study: Study) -> Plan:
    source = read_record(trajectory, TrajectoryRecord, "time", *MOTION)
    planned = {name: getattr(source, name) for name in MOTION}
    settings = study.simulation.computed_torque
    with settings_of("simulation", study), about(trajectory, ComputationError):
        plan = plan_of(source.time, planned, settings.control_rate_hz)
        start_of(plan, np.array(settings.initial_error_rad))
        return plan


def _controllers(plan: Plan, model: TorqueModel, rigid_body: Array, vehicle: VehicleSettings) -> list[Controller]:
    """List the controllers that are compared.

    The D_ii of the rigid body that fits the same samples scale the feedback of the controller without a model. No other
    controller can beat the one with the exact inertia, where the vehicle of the config is what is controlled.
    """
    tensor = symmetric(rigid_body)
    return [
        Controller("model", computed_torque(model)),
        Controller("rigid-body", computed_torque(RigidBody(tensor))),
        Controller("pd", proportional_derivative(np.diagonal(inertia_matrix(plan.attitude[:1], tensor)[0]))),
        Controller("vehicle", computed_torque(RigidBody(inertia_tensor(vehicle)))),
    ]


def _loop(
    plan: Plan,
    settings: ComputedTorqueSettings,
    model: InertiaModel,
    vehicle: VehicleSettings,
    rng: np.random.Generator,
) -> AttitudeLoop:
    """Arrange what closes the loop; the generator gives the noise that the controllers measure."""
    limit, noise = settings.torque_max_n_m, (settings.attitude_noise_rad, settings.body_rate_noise_rad_s)
    measured = (std * rng.standard_normal(plan.attitude.shape) for std in noise)
    return AttitudeLoop(
        plant=turning_law(model if settings.plant == "model" else six_parameters(vehicle.inertia_kg_m2)),
        gains=gains(settings.natural_frequency_hz, settings.damping),
        actuators=TorqueActuators(settings.rotor_time_constant_s, None if limit is None else np.array(limit)),
        sensing=Sensing(*measured) if any(noise) else None,
        integration_rate=settings.integration_rate_hz,
    )


def _planned_torque(plan: Plan, vehicle: VehicleSettings) -> Array:
    """Compute the body torque that the exact vehicle needs at the start of the plan, shape (3,), N m."""
    start = (plan.attitude[:1], plan.rate[:1], plan.acceleration[:1])
    return np.asarray(body_torque(*start, inertia_tensor(vehicle))[0])


def _logged(
    exact: Mapping[str, Array], study: Study, rng: np.random.Generator
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Log a flight: rotor speeds where hover thrust lets all rotors do it, and noise, with its standard deviations."""
    weight = np.full(len(exact["time"]), study.vehicle.mass_kg * study.vehicle.gravity_m_s2)
    demand = rotor_demand(study.vehicle, weight, exact["body_torque"])
    rotors = {} if demand.violations else {"rotor_speed": demand.speed}
    signals, std = noisy({**exact, **rotors}, study.simulation, rng)
    if {"attitude", "torque"} & std.keys():
        signals["body_torque"] = rotations.body_torque(signals["attitude"], signals["torque"])
    return signals, std
