"""Control laws of the attitude: computed torque with a model, proportional-derivative feedback alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import log, pi, sqrt
from typing import Protocol

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.vehicle.rigid_body import newton_euler_torque

_SETTLED = 1e-6


class TorqueModel(Protocol):
    """A model that knows the generalised torque of a motion, ``D(q) qdd + C(q, qd) qd``."""

    def torque(self, motion: Motion) -> Array:
        """Evaluate the generalised torque, shape (samples, 3), N m."""
        ...


@dataclass(frozen=True)
class RigidBody:
    """A rigid body as a model.

    Attributes
    ----------
    inertia : array, shape (3, 3), kg m^2, body frame
    """

    inertia: Array

    def torque(self, motion: Motion) -> Array:
        """Compute the generalised torque, shape (samples, 3), N m."""
        return newton_euler_torque(motion.attitude, motion.rate, motion.acceleration, self.inertia)


@dataclass(frozen=True)
class Gains:
    """Feedback that makes the error of a perfect model a damped oscillation, ``e'' + Kd e' + Kp e = 0``.

    Attributes
    ----------
    frequency : array, shape (3,), rad/s
        Natural frequency of roll, pitch and yaw.
    ratio : float
        Damping, 1 is critical.
    """

    frequency: Array
    ratio: float

    def feedback(self, error: Array, rate_error: Array) -> Array:
        """Compute ``Kp e + Kd e'`` with ``Kp = omega^2`` and ``Kd = 2 zeta omega``.

        Parameters
        ----------
        error, rate_error : array, shape (..., 3), rad and rad/s
            Planned less flown.

        Returns
        -------
        array, shape (..., 3), rad/s^2
        """
        return np.asarray(self.frequency**2 * error + 2 * self.ratio * self.frequency * rate_error)

    @property
    def settling_time(self) -> float:
        """Time constant of the slowest mode times 13.8: an initial error has died down to about a millionth, s."""
        slowest = float(np.min(self.frequency))
        beyond = sqrt(max(self.ratio**2 - 1, 0.0))
        return -log(_SETTLED) / (slowest * (self.ratio - beyond))


def gains(natural_frequency: tuple[float, float, float], damping: float) -> Gains:
    """Make gains from natural frequencies and damping.

    Parameters
    ----------
    natural_frequency : tuple of float, Hz
        Of roll, pitch and yaw.
    damping : float
    """
    return Gains(2 * pi * np.array(natural_frequency), damping)


Law = Callable[[Array, Array, Array, Array], Array]
"""Takes attitude, Euler rates, feedback and planned Euler acceleration, shape (3,) each; gives generalised torque."""


@dataclass(frozen=True)
class Controller:
    """A law with a name."""

    name: str
    law: Law


def computed_torque(model: TorqueModel) -> Law:
    """Command the torque that the model asks for the wanted motion, ``tau = D(q) v + C(q, qd) qd``.

    ``v = qdd_planned + Kd e' + Kp e`` in Euler coordinates.

    References
    ----------
    Spong, Hutchinson and Vidyasagar, Robot Modeling and Control, section 9.3 (inverse dynamics).
    """

    def law(attitude: Array, rate: Array, feedback: Array, acceleration: Array) -> Array:
        return np.asarray(model.torque(Motion(attitude[None], rate[None], (acceleration + feedback)[None]))[0])

    return law


def proportional_derivative(inertia: Array) -> Law:
    """Command feedback alone, ``tau_i = D_ii (Kd e'_i + Kp e_i)`` with constant D_ii.

    Parameters
    ----------
    inertia : array, shape (3,), kg m^2
        D_ii.
    """

    def law(_attitude: Array, _rate: Array, feedback: Array, _acceleration: Array) -> Array:
        return np.asarray(inertia * feedback)

    return law
