"""The collective thrust of a motion: what its acceleration takes, or what a held vehicle needs to turn its rotors."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.vehicle.rotors import rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings


def collective_thrust(vehicle: VehicleSettings, body_torque: Array, acceleration: Array | None) -> Array:
    """Find the total thrust along body z.

    In flight it is ``m |a + g e3|``. A vehicle that is held at its centre of mass has it free: it is then the
    smallest at which the torque asks no rotor to turn backwards, as every rotor of a lone thrust turns forwards.

    Parameters
    ----------
    vehicle : VehicleSettings
    body_torque : array, shape (time, 3), N m, body frame
    acceleration : array, shape (time, 3), m/s^2, world frame, or None
        None where the vehicle is held.

    Returns
    -------
    array, shape (time,), N

    Raises
    ------
    ComputationError
        If the rotors cannot produce thrust, roll, pitch and yaw independently, or a torque is not finite.
    """
    if acceleration is not None:
        specific_force = acceleration + np.array([0.0, 0.0, vehicle.gravity_m_s2])
        return np.asarray(vehicle.mass_kg * np.linalg.norm(specific_force, axis=1))
    none = np.zeros(len(body_torque))
    by_torque = rotor_demand(vehicle, none, body_torque).squared_speed
    by_thrust = rotor_demand(vehicle, np.ones(1), np.zeros((1, 3))).squared_speed[0]
    turning = by_thrust > 0
    least = np.maximum(-by_torque[:, turning] / by_thrust[turning], 0.0)
    return np.asarray(least.max(axis=1, initial=0.0))
