"""Natural sizes of coefficients on a vehicle, so that bounds are stated once for all vehicles."""

from __future__ import annotations

from math import sqrt

import numpy as np

from cpfls_cli.vehicle.settings import VehicleSettings


def hover_speed(vehicle: VehicleSettings) -> float:
    """Compute the rotor speed that carries the weight, rad/s.

    Parameters
    ----------
    vehicle : VehicleSettings

    Returns
    -------
    float
    """
    thrust_factor = sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors)
    return sqrt(vehicle.mass_kg * vehicle.gravity_m_s2 / thrust_factor)


def arm(vehicle: VehicleSettings) -> float:
    """Find the largest horizontal distance of a hub, m.

    Parameters
    ----------
    vehicle : VehicleSettings

    Returns
    -------
    float
    """
    return float(max(np.hypot(rotor.position_m[0], rotor.position_m[1]) for rotor in vehicle.rotors))


def drag_per_rotor_speed(vehicle: VehicleSettings) -> float:
    """Size a rotor drag that takes 1 m/s off each m/s in a second, N s^2/(m rad).

    Parameters
    ----------
    vehicle : VehicleSettings

    Returns
    -------
    float
    """
    return vehicle.mass_kg / (len(vehicle.rotors) * hover_speed(vehicle))
