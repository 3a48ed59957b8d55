"""The autopilot: the planned motion between its samples, position control, and geometric attitude control."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.interpolate import CubicSpline

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.rigid_body import inertia_tensor
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.vehicle.settings import VehicleSettings


@dataclass(frozen=True)
class Reference:
    """A planned motion at the steps of the autopilot; time is the first axis.

    Attributes
    ----------
    position, velocity, acceleration : array, shape (time, 3), m and s, world frame
    attitude : array, shape (time, 3), rad
    body_rate : array, shape (time, 3), rad/s, body frame
    body_acceleration : array, shape (time, 3), rad/s^2, body frame
    """

    position: Array
    velocity: Array
    acceleration: Array
    attitude: Array
    body_rate: Array
    body_acceleration: Array


def reference(planned: Mapping[str, Array], time: Array, at: Array) -> Reference:
    """Interpolate a planned motion by cubic splines.

    Parameters
    ----------
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, `position`, `velocity`, `acceleration`, shape
        (time, 3) each.
    time : array, shape (time,), s
    at : array, shape (step,), s
        Times asked for.

    Returns
    -------
    Reference
        Of shape (step, 3) each.
    """
    names = ("position", "velocity", "acceleration", "attitude", "attitude_rate", "attitude_acceleration")
    splines = CubicSpline(time, np.stack([planned[name] for name in names], axis=1))
    position, velocity, acceleration, q, qd, qdd = np.moveaxis(splines(at), 1, 0)
    return Reference(
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        attitude=q,
        body_rate=rotations.body_rate(q, qd),
        body_acceleration=rotations.body_acceleration(q, qd, qdd),
    )


class Autopilot:
    """Track a planned motion with the vehicle's model, without knowledge of the effects.

    References
    ----------
    Lee, Leok and McClamroch 2010, Geometric tracking control of a quadrotor UAV on SE(3).
    """

    def __init__(self, vehicle: VehicleSettings, settings: ClosedLoopSettings, planned: Reference) -> None:
        position = 2 * pi * settings.position_frequency_hz
        attitude = 2 * pi * np.array([settings.attitude_frequency_hz] * 2 + [settings.yaw_frequency_hz])
        self._position_gain, self._velocity_gain = position**2, 2 * settings.position_damping * position
        self._attitude_gain, self._rate_gain = attitude**2, 2 * settings.attitude_damping * attitude
        self._planned = planned
        self._inertia = inertia_tensor(vehicle)
        self._mass = vehicle.mass_kg
        self._gravity = np.array([0.0, 0.0, vehicle.gravity_m_s2])

    def wrench(self, step: int, position: Array, velocity: Array, rotation: Array, body_rate: Array) -> Array:
        """Compute the thrust and the torque that the motion asks for.

        Parameters
        ----------
        step : int
            Index into the planned motion.
        position, velocity : array, shape (3,), m and m/s, world frame
        rotation : array, shape (3, 3)
            Body to world.
        body_rate : array, shape (3,), rad/s, body frame

        Returns
        -------
        array, shape (4,), N and N m
            Thrust along body z, body torque.
        """
        planned = self._planned
        pull = self._gravity + planned.acceleration[step] + self._position_gain * (planned.position[step] - position)
        pull += self._velocity_gain * (planned.velocity[step] - velocity)
        target = upright(pull, planned.attitude[step, 2])
        torque = self._torque(step, target.T @ rotation, body_rate)
        return np.array([self._mass * (pull @ rotation[:, 2]), *torque])

    def _torque(self, step: int, turned: Array, body_rate: Array) -> Array:
        """Compute the torque that turns the body to its target attitude."""
        skew = 0.5 * (turned - turned.T)
        error = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
        rate_error = body_rate - turned.T @ self._planned.body_rate[step]
        wanted = turned.T @ self._planned.body_acceleration[step]
        wanted = wanted - self._attitude_gain * error - self._rate_gain * rate_error
        return np.asarray(self._inertia @ wanted + np.cross(body_rate, self._inertia @ body_rate))


def upright(pull: Array, yaw: float) -> Array:
    """Orient a body whose z axis points along the pull, with a given yaw.

    Parameters
    ----------
    pull : array, shape (3,), world frame
    yaw : float, rad

    Returns
    -------
    array, shape (3, 3)
        Body to world.
    """
    up = pull / np.sqrt(pull @ pull)
    # By the definition of yaw the x axis lies in the vertical plane of the heading, however the body rolls.
    forward = np.cross([-np.sin(yaw), np.cos(yaw), 0.0], up)
    forward /= np.sqrt(forward @ forward)
    return np.column_stack([forward, np.cross(up, forward), up])
