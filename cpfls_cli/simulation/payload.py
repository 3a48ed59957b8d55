"""A load on a cable: a spherical pendulum that drives the vehicle which drives it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array

# Where the coefficients of the catalogue have the hook.
_HOOK = MappingProxyType(
    {
        "mass_times_depth": (0.0, 0.0, -1.0),
        "mass_times_right": (0.0, -1.0, 0.0),
        "mass_times_behind": (-1.0, 0.0, 0.0),
    }
)


class Carrier(NamedTuple):
    """The vehicle that carries the load.

    Attributes
    ----------
    mass : float, kg
    inertia : array, shape (3, 3), kg m^2, body frame
    rotation : array, shape (3, 3)
        Body to world.
    body_rate : array, shape (3,), rad/s, body frame
    """

    mass: float
    inertia: Array
    rotation: Array
    body_rate: Array


class Pull(NamedTuple):
    """What a load does to its carrier.

    Attributes
    ----------
    acceleration : array, shape (3,), m/s^2, world frame
    turning : array, shape (3,), rad/s^2, body frame
    swing : array, shape (3,), 1/s^2, world frame
        Second derivative of the direction of the cable.
    """

    acceleration: Array
    turning: Array
    swing: Array


@dataclass(frozen=True)
class Payload:
    """Direction n of the cable, ``n'' = -(a + g z)_across / L - |n'|^2 n - c n'``, and its pull ``m_p t n``.

    With a the acceleration of the hook and the tension per mass ``t = L |n'|^2 - (a + g z) . n``.

    Attributes
    ----------
    mass : float, kg
    mass_times_hook : array, shape (3,), kg m, body frame
        Lever of the pull, times the mass.
    depth : float, m
        How far below the centre of mass the hook moves.
    length : float, m
        L.
    damping : float, 1/s
        c.
    gravity : float, m/s^2
    """

    mass: float
    mass_times_hook: Array
    depth: float
    length: float
    damping: float
    gravity: float

    def pull(self, carrier: Carrier, acceleration: Array, turning: Array, cable: Array, rate: Array) -> Pull:
        """Pull at a carrier whose acceleration depends on the pull; both are linear in the tension.

        Parameters
        ----------
        carrier : Carrier
        acceleration, turning : array, shape (3,), m/s^2 in the world, rad/s^2 in the body
            What the carrier would do without the load.
        cable, rate : array, shape (3,), 1 and 1/s, world frame
            Direction from the hook to the load, and its derivative.
        """
        hook = np.array([0.0, 0.0, -self.depth])
        pulled = self.mass / carrier.mass * cable
        turned = np.linalg.solve(carrier.inertia, np.cross(self.mass_times_hook, carrier.rotation.T @ cable))
        bent = np.cross(turning, hook) + np.cross(carrier.body_rate, np.cross(carrier.body_rate, hook))
        felt = acceleration + carrier.rotation @ bent
        felt[2] += self.gravity
        response = pulled + carrier.rotation @ np.cross(turned, hook)
        tension = (self.length * rate @ rate - felt @ cable) / (1 + response @ cable)
        felt = felt + tension * response
        across = felt - (felt @ cable) * cable
        swing = -across / self.length - (rate @ rate) * cable - self.damping * rate
        return Pull(tension * pulled, tension * turned, swing)


def payload(values: Mapping[str, float], gravity: float) -> Payload:
    """Hang a load under a vehicle.

    Parameters
    ----------
    values : mapping of str to float
        Of the effect payload.
    gravity : float, m/s^2
    """
    lever = sum((value * np.array(_HOOK[name]) for name, value in values.items() if name in _HOOK), np.zeros(3))
    depth = values.get("depth_m", 0.0)
    return Payload(values["mass"], lever, depth, values["length_m"], values["damping_1_s"], gravity)
