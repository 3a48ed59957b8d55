"""A load on a cable as a pendulum that the motion of the vehicle drives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array


@dataclass(frozen=True)
class Payload:
    """A small swing, ``e'' + c e' + (g/L) e = -a/L``, of a cable that carries ``m_p (g + a_z)``.

    Attributes
    ----------
    mass : float, kg
    mass_times_attachment : float, kg m
        Mass times depth of the hook below the centre of mass.
    length : float, m
    damping : float, 1/s
    gravity : float, m/s^2
    """

    mass: float
    mass_times_attachment: float
    length: float
    damping: float
    gravity: float

    def cable(self, swing: Array) -> Array:
        """Point along the cable.

        Parameters
        ----------
        swing : array, shape (2,)
            Horizontal distance from the vehicle over the length, world frame.

        Returns
        -------
        array, shape (3,), world frame
            Of length 1.
        """
        line = np.array([*swing, -1.0])
        return np.asarray(line / np.sqrt(line @ line))

    def acceleration(self, free: Array, cable: Array, vehicle_mass: float) -> Array:
        """Accelerate the vehicle under a load whose pull depends on that acceleration.

        Parameters
        ----------
        free : array, shape (3,), m/s^2, world frame
            Acceleration without the load.
        cable : array, shape (3,)
        vehicle_mass : float, kg

        Returns
        -------
        array, shape (3,), m/s^2, world frame
        """
        share = self.mass / vehicle_mass
        felt = (self.gravity + free[2]) / (1 - share * cable[2])
        return np.asarray(free + share * felt * cable)

    def torque(self, acceleration: Array, cable: Array, rotation: Array) -> Array:
        """Compute the torque of the hook.

        Parameters
        ----------
        acceleration : array, shape (3,), m/s^2, world frame
        cable : array, shape (3,)
        rotation : array, shape (3, 3)
            Body to world.

        Returns
        -------
        array, shape (3,), N m, body frame
        """
        x, y, _ = self.mass_times_attachment * (self.gravity + acceleration[2]) * (rotation.T @ cable)
        # The hook is below the centre of mass: -z x pull.
        return np.array([y, -x, 0.0])

    def swing_acceleration(self, swing: Array, rate: Array, acceleration: Array) -> Array:
        """Swing on.

        Parameters
        ----------
        swing, rate : array, shape (2,)
        acceleration : array, shape (3,), m/s^2, world frame
            Of the vehicle.

        Returns
        -------
        array, shape (2,), 1/s^2
        """
        return np.asarray(-self.damping * rate - (self.gravity * swing + acceleration[:2]) / self.length)
