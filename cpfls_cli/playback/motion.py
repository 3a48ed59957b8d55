"""Where vehicles are and how they move."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.vehicle.settings import VehicleSettings


class State(NamedTuple):
    """Where vehicles are and how they move.

    Attributes
    ----------
    position, velocity : array, shape (samples, 3), m and m/s, world frame
    rotation : array, shape (samples, 3, 3)
        Body to world.
    rate : array, shape (samples, 3), rad/s, body frame
    """

    position: Array
    velocity: Array
    rotation: Array
    rate: Array


class MeasuredMotion(NamedTuple):
    """Measured motion, where runs start and what they are held against.

    Attributes
    ----------
    position, velocity : array, shape (time, 3), m and m/s, world frame
    rotation : array, shape (time, 3, 3)
        Body to world.
    rate : array, shape (time, 3), rad/s, body frame
    period : float, s
    """

    position: Array
    velocity: Array
    rotation: Array
    rate: Array
    period: float


class Body(NamedTuple):
    """What is moved.

    Attributes
    ----------
    inertia, inverse : array, shape (3, 3)
    """

    mass: float
    gravity: float
    inertia: Array
    inverse: Array

    @classmethod
    def of(cls, vehicle: VehicleSettings, inertia: Array) -> Body:
        """Arrange mass and inertia, which may be another than the vehicle's."""
        return cls(vehicle.mass_kg, vehicle.gravity_m_s2, inertia, np.asarray(np.linalg.inv(inertia), dtype=float))


FASTEST = 300.0
"""Body rate in rad/s, and speed in m/s, at which a run is called diverged and stays as it was."""
