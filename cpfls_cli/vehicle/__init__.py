"""The multirotor: its settings and its rotors."""

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
    "body_wrench",
    "rotor_demand",
]
