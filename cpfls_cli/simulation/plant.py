"""The flown vehicle: rigid body, rotors, and what its model lacks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.equations_of_motion import TurningLaw
from cpfls_cli.effects.signals import Signals
from cpfls_cli.simulation.actuators import Rotors
from cpfls_cli.simulation.missing_wrench import MissingWrench
from cpfls_cli.simulation.payload import Carrier, Payload
from cpfls_cli.vehicle.settings import VehicleSettings

POSITION, VELOCITY, ATTITUDE, BODY_RATE = (slice(3 * n, 3 * n + 3) for n in range(4))
CABLE, CABLE_RATE = slice(12, 15), slice(15, 18)
STATES = 18
"""Places in the state: position and velocity in the world, attitude as roll, pitch and yaw, body rate;
direction of the cable of a load in the world, and its rate."""


@dataclass(frozen=True)
class Plant:
    """``(I + dI) omega' = M - omega x I omega``, ``m v' = R F - m g``.

    Attributes
    ----------
    vehicle : VehicleSettings
    turning : callable
        Of the model.
    missing : MissingWrench
    payload : Payload or None
    """

    vehicle: VehicleSettings
    turning: TurningLaw
    missing: MissingWrench
    payload: Payload | None

    def derivative(self, state: Array, rotors: Rotors) -> Array:
        """Differentiate the state.

        Parameters
        ----------
        state : array, shape (18,)
        rotors : Rotors

        Returns
        -------
        array, shape (18,)
        """
        body_rate = state[BODY_RATE]
        signals = instant(self.vehicle, state, rotors.speed)
        wrench = signals.wrench[0] + self.missing.direct(signals)
        own = self.turning(state[ATTITUDE], body_rate)
        torque = wrench[:3] - own.direct + self.missing.rotor_coupling @ rotors.acceleration
        acceleration = signals.rotation[0] @ wrench[3:] / self.vehicle.mass_kg
        acceleration[2] -= self.vehicle.gravity_m_s2
        inertia = own.inertia + self.missing.added_inertia
        turning = np.linalg.solve(inertia, torque)
        change = np.zeros(STATES)
        if self.payload is not None:
            cable, rate = state[CABLE] / np.linalg.norm(state[CABLE]), state[CABLE_RATE]
            carrier = Carrier(self.vehicle.mass_kg, inertia, signals.rotation[0], body_rate)
            pull = self.payload.pull(carrier, acceleration, turning, cable, rate)
            acceleration, turning = acceleration + pull.acceleration, turning + pull.turning
            change[CABLE], change[CABLE_RATE] = rate, pull.swing
        change[POSITION], change[VELOCITY] = state[VELOCITY], acceleration
        change[ATTITUDE] = rotations.attitude_rate(state[None, ATTITUDE], body_rate[None])[0]
        change[BODY_RATE] = turning
        return change


def instant(vehicle: VehicleSettings, state: Array, rotor_speed: Array) -> Signals:
    """Show one instant as a flight of one sample.

    Parameters
    ----------
    vehicle : VehicleSettings
    state : array, shape (18,)
    rotor_speed : array, shape (rotor,), rad/s
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
