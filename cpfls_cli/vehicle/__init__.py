"""The multirotor: its rigid-body rotation and its rotors."""

from cpfls_cli.vehicle.rigid_body import (
    body_torque,
    inertia_matrix,
    inertia_matrix_gradient,
    inertia_tensor,
    newton_euler_torque,
    rigid_body_regressor,
    torque,
)
from cpfls_cli.vehicle.rotors import (
    BodyWrench,
    RotorDemand,
    RotorViolation,
    allocation_matrix,
    body_wrench,
    rotor_demand,
)
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

__all__ = [
    "BodyWrench",
    "RotorDemand",
    "RotorSettings",
    "RotorViolation",
    "VehicleSettings",
    "allocation_matrix",
    "body_torque",
    "body_wrench",
    "inertia_matrix",
    "inertia_matrix_gradient",
    "inertia_tensor",
    "newton_euler_torque",
    "rigid_body_regressor",
    "rotor_demand",
    "torque",
]
