"""What a vehicle model does: accelerations, and one step forward.

The compiled loops of `cpfls_cli.playback.kernels` take the same step along flights; here it is written for states that
stand side by side, and for those who want to read it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.rotations import turns


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


def accelerations(model: VehicleModel, state: State, rotor: Array) -> tuple[Array, Array]:
    """Compute ``v' = g + R F / m`` and ``omega' = I^-1 (M - omega x I omega)``.

    Parameters
    ----------
    model : VehicleModel
        Of constant inertia.
    rotor : array, shape (samples, 1 + 4 rotors)
        See `RotorResponse.terms_by_step`.

    Returns
    -------
    linear : array, shape (samples, 3), m/s^2, world frame
    angular : array, shape (samples, 3), rad/s^2, body frame
    """
    body = model.body
    air = np.einsum("nji,nj->ni", state.rotation, state.velocity - model.wind)
    wrench = model.table.wrench(air, state.rate, rotor)
    linear = np.einsum("nij,nj->ni", state.rotation, wrench[:, 3:]) / body.mass
    linear[:, 2] -= body.gravity
    angular = (wrench[:, :3] - np.cross(state.rate, state.rate @ body.inertia)) @ body.inverse
    return linear, np.asarray(angular)


def step(model: VehicleModel, state: State, rotor: Array, period: float) -> State:
    """Take one step of the midpoint rule, with rotors that are constant over it.

    Parameters
    ----------
    model : VehicleModel
        Of constant inertia.
    rotor : array, shape (samples, 1 + 4 rotors)
        See `RotorResponse.terms_by_step`.
    period : float, s
    """
    half = 0.5 * period
    linear, angular = accelerations(model, state, rotor)
    middle = State(
        state.position,
        state.velocity + half * linear,
        state.rotation @ turns(half * state.rate),
        state.rate + half * angular,
    )
    linear, angular = accelerations(model, middle, rotor)
    return State(
        state.position + period * middle.velocity,
        state.velocity + period * linear,
        state.rotation @ turns(period * middle.rate),
        state.rate + period * angular,
    )
