"""Natural sizes of coefficients on a vehicle, so that bounds are stated once for all vehicles."""

from collections.abc import Callable
from math import sqrt

import numpy as np

from cpfls_cli.vehicle.settings import VehicleSettings


def hover_speed(vehicle: VehicleSettings) -> float:
    """Compute the rotor speed that carries the weight, rad/s."""
    thrust_factor = sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors)
    return sqrt(vehicle.mass_kg * vehicle.gravity_m_s2 / thrust_factor)


def arm(vehicle: VehicleSettings) -> float:
    """Find the largest horizontal distance of a hub, m."""
    return float(max(np.hypot(rotor.position_m[0], rotor.position_m[1]) for rotor in vehicle.rotors))


def drag_per_rotor_speed(vehicle: VehicleSettings) -> float:
    """Size a rotor drag that takes 1 m/s off each m/s in a second, N s^2/(m rad)."""
    return vehicle.mass_kg / (len(vehicle.rotors) * hover_speed(vehicle))


def arm_drag(vehicle: VehicleSettings) -> float:
    """Size a moment at each rotor by a rotor drag at the end of the arm, kg m/rad."""
    return drag_per_rotor_speed(vehicle) * arm(vehicle)


def weight(vehicle: VehicleSettings) -> float:
    """Compute the weight, N."""
    return vehicle.mass_kg * vehicle.gravity_m_s2


def arm_weight(vehicle: VehicleSettings) -> float:
    """Size a torque by the weight at the end of an arm, N m."""
    return weight(vehicle) * arm(vehicle)


def mass(vehicle: VehicleSettings) -> float:
    """Give the mass, kg."""
    return vehicle.mass_kg


def arm_mass(vehicle: VehicleSettings) -> float:
    """Size a mass on a lever by the vehicle's own at the end of an arm, kg m."""
    return vehicle.mass_kg * arm(vehicle)


def drag_at_ten_metres_per_second(vehicle: VehicleSettings) -> float:
    """Size a quadratic drag that equals the weight at 10 m/s, N s^2/m^2."""
    return weight(vehicle) / 10.0**2


def arm_drag_at_ten_metres_per_second(vehicle: VehicleSettings) -> float:
    """Size the torque of a quadratic drag that equals the weight at 10 m/s and acts at the end of an arm, N s^2/m."""
    return drag_at_ten_metres_per_second(vehicle) * arm(vehicle)


def lift_at_ten_metres_per_second(vehicle: VehicleSettings) -> float:
    """Size a gain that doubles the hover thrust of a rotor at 10 m/s, N s^2/m^2."""
    return drag_at_ten_metres_per_second(vehicle) / len(vehicle.rotors)


MOMENTS: tuple[Callable[[VehicleSettings], float], ...] = (
    lambda vehicle: float(vehicle.inertia_kg_m2[0]),
    lambda vehicle: float(vehicle.inertia_kg_m2[1]),
    lambda vehicle: float(vehicle.inertia_kg_m2[2]),
)
"""Moments of inertia about x, y, z, kg m^2: a damping of that size takes 1 rad/s off each rad/s in a second."""


def smallest_inertia(vehicle: VehicleSettings) -> float:
    """Find the smallest of the moments Ixx, Iyy, Izz, kg m^2."""
    return float(min(vehicle.inertia_kg_m2[:3]))


def inertia_per_rotor_speed(vehicle: VehicleSettings) -> float:
    """Size a rotor damping that takes 1 rad/s off each rad/s in a second while hovering, N m s^2/rad^2."""
    return smallest_inertia(vehicle) / (len(vehicle.rotors) * hover_speed(vehicle))


def lean_per_rotor_speed(vehicle: VehicleSettings) -> float:
    """Size a thrust that leans by the rate over the rotor speed, N s^2/rad^2."""
    return sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors) / len(vehicle.rotors)
