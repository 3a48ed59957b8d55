"""A vehicle with two loads that slide along body x with its attitude, held at its centre of mass, in closed form.

Two equal point masses m stand on the rail at x = +s and x = -s, so the centre of mass rests and gravity does nothing.
The body's kinetic energy is joined by that of the loads, ``m s^2 (omega_y^2 + omega_z^2) + m (ds/dt)^2``: with
``I(q) = I + 2 m s^2 diag(0, 1, 1)`` the whole is ``1/2 qd^T D qd``, ``D = W^T I(q) W + 2 m grad s grad s^T``.

A cam that the rings of a gimbal drive keeps the loads at s(q) without work, and the torque on the Euler angles is the
Lagrangian one of D. Where servos hold them at the same s(q) it is not: they do work, and lean on the body alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.regressor.motion import Motion

MASS_KG = 6.0
"""Of the paper's vehicle, without loads."""

OUTERMOST_M, SHARPNESS = 0.4, 2.0
ACROSS = np.array([0.0, 1.0, 1.0])


@dataclass(frozen=True)
class SlidingLoads:
    """Two loads on a rail, 0.4 m from the middle upright and one stroke nearer upside down.

    ``s = 0.4 m - stroke (1 - tanh(2 c) / tanh 2) / 2``, with c the cosine of roll, or of the tilt.

    Attributes
    ----------
    mass_share : float
        Of both loads together, of the vehicle's mass without them.
    stroke : float, m
    by : {"roll", "tilt"}
        What moves the loads.
    held_by : {"cam", "servo"}
    """

    mass_share: float
    stroke: float = 0.1
    by: Literal["roll", "tilt"] = "roll"
    held_by: Literal["cam", "servo"] = "cam"

    @property
    def mass(self) -> float:
        """Mass of one load, kg."""
        return 0.5 * self.mass_share * MASS_KG

    def torque(self, motion: Motion) -> Array:
        """Compute what the loads add to the generalised torque, shape (samples, 3), N m.

        By Newton and Euler: the loads' angular momentum is ``2 m s^2 (0, omega_y, omega_z)``, and along the rail both
        together take ``2 m (s'' - s (omega_y^2 + omega_z^2))``, which a cam passes on to the angles by grad s.
        """
        place, gradient, speed, acceleration = self.place(motion)
        rate = rotations.body_rate(motion.attitude, motion.rate) * ACROSS
        turning = rotations.body_acceleration(motion.attitude, motion.rate, motion.acceleration) * ACROSS
        inertia, change = 2 * self.mass * place**2, 4 * self.mass * place * speed
        momentum = inertia[:, None] * rate
        spin = rotations.body_rate(motion.attitude, motion.rate)
        about_body = inertia[:, None] * turning + change[:, None] * rate + np.cross(spin, momentum)
        added = rotations.generalised_torque(motion.attitude, about_body)
        if self.held_by == "cam":
            added += gradient * (2 * self.mass * (acceleration - place * np.sum(rate**2, axis=1)))[:, None]
        return np.asarray(added)

    def own_motion(self, motion: Motion) -> Array:
        """Compute the part of it on a cam that comes from ``m (ds/dt)^2``: ``2 m s'' grad s``."""
        _, gradient, _, acceleration = self.place(motion)
        return np.asarray(2 * self.mass * acceleration[:, None] * gradient)

    def place(self, motion: Motion) -> tuple[Array, Array, Array, Array]:
        """Follow a load along a motion: s, its gradient by the angles, speed and acceleration along the rail."""
        (roll, pitch, _), rate, turning = motion.attitude.T, motion.rate, motion.acceleration
        pitch = pitch if self.by == "tilt" else np.zeros_like(pitch)
        cosine, gradient = np.cos(roll) * np.cos(pitch), np.zeros_like(rate)
        gradient[:, 0] = -np.sin(roll) * np.cos(pitch)
        across = 0.0
        if self.by == "tilt":
            gradient[:, 1] = -np.cos(roll) * np.sin(pitch)
            across = 2 * np.sin(roll) * np.sin(pitch) * rate[:, 0] * rate[:, 1] - cosine * rate[:, 1] ** 2
        speed = np.sum(gradient * rate, axis=1)
        acceleration = np.sum(gradient * turning, axis=1) - cosine * rate[:, 0] ** 2 + across
        bent, half = np.tanh(SHARPNESS * cosine), 0.5 * self.stroke / np.tanh(SHARPNESS)
        place = OUTERMOST_M - 0.5 * self.stroke + half * bent
        first = half * SHARPNESS * (1 - bent**2)
        second = -2 * SHARPNESS * bent * first
        return place, first[:, None] * gradient, first * speed, first * acceleration + second * speed**2

    def on(self, flight: TorqueData) -> TorqueData:
        """Load the vehicle of a flight along the same motion."""
        return replace(flight, torque=flight.torque + self.torque(flight.motion))
