"""Which controllers are compared, and what closes their loop."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.control import (
    AttitudeLoop,
    Controller,
    Plan,
    Sensing,
    TorqueActuators,
    computed_torque,
    gains,
    proportional_derivative,
)
from cpfls_cli.dynamics.equations_of_motion import RigidBody, TorqueModel, model_plant, rigid_plant
from cpfls_cli.dynamics.rigid_body import body_torque, inertia_matrix, inertia_tensor
from cpfls_cli.inertia import symmetric
from cpfls_cli.simulation import ComputedTorqueSettings
from cpfls_cli.vehicle.settings import VehicleSettings


def controllers_of(plan: Plan, model: TorqueModel, rigid_body: Array, vehicle: VehicleSettings) -> list[Controller]:
    """List the controllers that are compared.

    Parameters
    ----------
    model : TorqueModel
        Identified.
    rigid_body : array, shape (6,), kg m^2
        That fits the same samples; its D_ii at the planned start scale the feedback of the controller without a model.
    vehicle : VehicleSettings
        Whose exact inertia no other controller can beat, where it is what is controlled.
    """
    tensor = symmetric(rigid_body)
    return [
        Controller("model", computed_torque(model)),
        Controller("rigid-body", computed_torque(RigidBody(tensor))),
        Controller("pd", proportional_derivative(np.diagonal(inertia_matrix(plan.attitude[:1], tensor)[0]))),
        Controller("vehicle", computed_torque(RigidBody(inertia_tensor(vehicle)))),
    ]


def loop_of(
    plan: Plan,
    settings: ComputedTorqueSettings,
    model: TorqueModel,
    vehicle: VehicleSettings,
    rng: np.random.Generator,
) -> AttitudeLoop:
    """Arrange what closes the loop.

    Parameters
    ----------
    model : TorqueModel
        Controlled where the settings say so.
    rng : numpy.random.Generator
        Source of the noise that the controllers measure.
    """
    limit, noise = settings.torque_max_n_m, (settings.attitude_noise_rad, settings.body_rate_noise_rad_s)
    measured = (std * rng.standard_normal(plan.attitude.shape) for std in noise)
    return AttitudeLoop(
        plant=model_plant(model) if settings.plant == "model" else rigid_plant(inertia_tensor(vehicle)),
        gains=gains(settings.natural_frequency_hz, settings.damping),
        actuators=TorqueActuators(settings.rotor_time_constant_s, None if limit is None else np.array(limit)),
        sensing=Sensing(*measured) if any(noise) else None,
        integration_rate=settings.integration_rate_hz,
    )


def planned_torque(plan: Plan, vehicle: VehicleSettings) -> Array:
    """Compute the torque that the exact vehicle needs at the start of the plan.

    Returns
    -------
    array, shape (3,), N m, body frame
    """
    start = (plan.attitude[:1], plan.rate[:1], plan.acceleration[:1])
    return np.asarray(body_torque(*start, inertia_tensor(vehicle))[0])
