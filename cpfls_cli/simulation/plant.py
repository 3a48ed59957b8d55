"""The flown vehicle: rigid body, rotors, and what its model lacks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.simulation.actuators import Rotors
from cpfls_cli.simulation.missing_wrench import MissingWrench
from cpfls_cli.simulation.payload import Payload
from cpfls_cli.vehicle.settings import VehicleSettings

POSITION, VELOCITY, ATTITUDE, BODY_RATE = (slice(3 * n, 3 * n + 3) for n in range(4))
SWING, SWING_RATE = slice(12, 14), slice(14, 16)
STATES = 16
"""Places in the state: position and velocity in the world, attitude as roll, pitch and yaw, body rate, swing."""


@dataclass(frozen=True)
class Plant:
    """``(I + dI) omega' = M - omega x I omega``, ``m v' = R F - m g``.

    Attributes
    ----------
    vehicle : VehicleSettings
    inertia : array, shape (3, 3), kg m^2
        Of the model.
    missing : MissingWrench
    payload : Payload or None
    """

    vehicle: VehicleSettings
    inertia: Array
    missing: MissingWrench
    payload: Payload | None

    def derivative(self, state: Array, rotors: Rotors) -> Array:
        """Differentiate the state.

        Parameters
        ----------
        state : array, shape (16,)
        rotors : Rotors

        Returns
        -------
        array, shape (16,)
        """
        body_rate = state[BODY_RATE]
        signals = instant(self.vehicle, state, rotors.speed)
        wrench = signals.wrench[0] + self.missing.direct(signals)
        torque = wrench[:3] - np.cross(body_rate, self.inertia @ body_rate)
        torque = torque + self.missing.rotor_coupling @ rotors.acceleration
        acceleration = signals.rotation[0] @ wrench[3:] / self.vehicle.mass_kg
        acceleration[2] -= self.vehicle.gravity_m_s2
        change = np.zeros(STATES)
        if self.payload is not None:
            cable = self.payload.cable(state[SWING])
            acceleration = self.payload.acceleration(acceleration, cable, self.vehicle.mass_kg)
            torque = torque + self.payload.torque(acceleration, cable, signals.rotation[0])
            change[SWING] = state[SWING_RATE]
            change[SWING_RATE] = self.payload.swing_acceleration(state[SWING], state[SWING_RATE], acceleration)
        change[POSITION], change[VELOCITY] = state[VELOCITY], acceleration
        change[ATTITUDE] = rotations.attitude_rate(state[None, ATTITUDE], body_rate[None])[0]
        change[BODY_RATE] = np.linalg.solve(self.inertia + self.missing.added_inertia, torque)
        return change


def instant(vehicle: VehicleSettings, state: Array, rotor_speed: Array) -> Signals:
    """Show one instant as a flight of one sample.

    Parameters
    ----------
    vehicle : VehicleSettings
    state : array, shape (16,)
    rotor_speed : array, shape (rotor,), rad/s

    Returns
    -------
    Signals
    """
    row = state[None]
    return Signals(
        time=np.zeros(1),
        vehicle=vehicle,
        position=row[:, POSITION],
        velocity=row[:, VELOCITY],
        attitude=row[:, ATTITUDE],
        body_rate=row[:, BODY_RATE],
        rotor_speed=rotor_speed[None],
    )
