"""How bodies turn under a torque, many at once: a rigid body, or a model in Euler coordinates."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.gap.replay.rate_equation import euler_angles
from cpfls_cli.inertia import symmetric
from cpfls_cli.simulation.turning import InertiaModel

Predictor = InertiaModel | Array
"""A model in Euler coordinates, or the six inertia parameters of a rigid body, shape (6,), kg m^2."""

# Below this |cos(pitch)| half of all digits are lost to the singularity of the Euler angles.
_STEEP = 1e-8


class State(NamedTuple):
    """Bodies that turn.

    Attributes
    ----------
    rotation : array, shape (bodies, 3, 3)
        Body to world.
    body_rate : array, shape (bodies, 3), rad/s, body frame
    beyond : array of bool, shape (bodies,)
        Whether the pitch is counted beyond +-90 degrees. Every attitude has Euler angles on both sides, and a model
        of the full circle has learned from those of the flight.
    exists : array of bool, shape (bodies,)
        False from where on a run is lost; it stays where it was.
    """

    rotation: Array
    body_rate: Array
    beyond: BoolArray
    exists: BoolArray


class Acceleration(NamedTuple):
    """Derivative of the body rates.

    Attributes
    ----------
    value : array, shape (bodies, 3), rad/s^2, body frame
        0 where there is none.
    exists : array of bool, shape (bodies,)
        False where the inertia is not positive definite: no torque turns such a body.
    """

    value: Array
    exists: BoolArray


Law = Callable[[State, Array], Acceleration]
"""Takes bodies and the torques on them, shape (bodies, 3), N m, body frame."""


def turning_law(predictor: Predictor) -> Law:
    """Give the equation of motion of a predictor.

    Parameters
    ----------
    predictor : InertiaModel or array, shape (6,)
    """
    return _rigid(symmetric(predictor)) if isinstance(predictor, np.ndarray) else _identified(predictor)


def _rigid(inertia: Array) -> Law:
    """Turn as ``I omega' = M - omega x I omega``."""

    def law(state: State, torque: Array) -> Acceleration:
        matrices = np.broadcast_to(inertia, (len(torque), 3, 3))
        return _solved(matrices, torque - np.cross(state.body_rate, state.body_rate @ inertia))

    return law


def _identified(model: InertiaModel) -> Law:
    """Turn as ``J qdd = W^T M - (dJ/dt) qd + 1/2 grad (qd^T J qd)``, and then ``omega' = W qdd + (dW/dt) qd``."""

    def law(state: State, torque: Array) -> Acceleration:
        q = _attitude(state)
        steep = np.abs(np.cos(q[:, 1])) < _STEEP
        q = np.where(steep[:, None], 0.0, q)
        qd = rotations.attitude_rate(q, state.body_rate)
        values = model.inertia(q)
        along = np.einsum("nkij,nk,nj->ni", values.gradient, qd, qd)
        potential = 0.5 * np.einsum("nkij,ni,nj->nk", values.gradient, qd, qd)
        found = _solved(values.value, rotations.generalised_torque(q, torque) - along + potential)
        return Acceleration(rotations.body_acceleration(q, qd, found.value), found.exists & ~steep)

    return law


def _attitude(state: State) -> Array:
    """Give the Euler angles on the side of the vertical that the pitch is counted on."""
    near = euler_angles(state.rotation)
    return np.where(state.beyond[:, None], np.pi + near * [1.0, -1.0, 1.0], near)


def _solved(matrices: Array, right_side: Array) -> Acceleration:
    exists = _positive_definite(matrices)
    safe = np.where(exists[:, None, None], matrices, np.eye(3))
    value = np.linalg.solve(safe, np.where(exists[:, None], right_side, 0.0)[..., None])[..., 0]
    return Acceleration(value, exists)


def _positive_definite(matrices: Array) -> BoolArray:
    """Tell by the leading minors (Sylvester), ten times as fast as by eigenvalues."""
    first, second = matrices[:, 0, 0], matrices[:, 1, 1]
    minor = first * second - matrices[:, 0, 1] ** 2
    return np.asarray((first > 0) & (minor > 0) & (np.linalg.det(matrices) > 0))
