"""The mixer: from thrust and torque to commands that the rotors can follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.vehicle.rotors import rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings

_ROUNDING = 1e-12


@dataclass(frozen=True)
class Mixer:
    """Allocate a wrench; where a rotor cannot follow, yaw gives way first, and the rest is clipped.

    Attributes
    ----------
    inverse : array, shape (4, rotor)
        Squared speeds for one unit of thrust and of each torque.
    limit : float, rad^2/s^2
        Largest squared speed.
    """

    inverse: Array
    limit: float

    def demand(self, wrench: Array) -> Array:
        """Compute the squared speeds that a wrench asks for, whether possible or not.

        Parameters
        ----------
        wrench : array, shape (4,)

        Returns
        -------
        array, shape (rotor,), rad^2/s^2
        """
        return np.asarray(wrench @ self.inverse)

    def command(self, wrench: Array) -> Array:
        """Compute rotor speeds that are possible.

        Parameters
        ----------
        wrench : array, shape (4,)

        Returns
        -------
        array, shape (rotor,), rad/s
        """
        upright, yaw = wrench[:3] @ self.inverse[:3], wrench[3] * self.inverse[3]
        room = np.where(yaw > 0, self.limit - upright, upright)
        # What yaw does not change by more than rounding sets no limit.
        loaded = np.abs(yaw) > _ROUNDING * self.limit
        share = np.min(room[loaded] / np.abs(yaw[loaded]), initial=1.0)
        return np.asarray(np.sqrt(np.clip(upright + max(share, 0.0) * yaw, 0.0, self.limit)))


def mixer(vehicle: VehicleSettings) -> Mixer:
    """Invert the allocation of a vehicle.

    Raises
    ------
    ComputationError
        If the rotors cannot produce thrust, roll, pitch and yaw independently.
    """
    units = np.eye(4)
    inverse = rotor_demand(vehicle, units[:, 0], units[:, 1:]).squared_speed
    return Mixer(inverse, vehicle.rotor_speed_max_rad_s**2)
