"""Equations of rotation: of models in Euler coordinates, ``J(q) qdd + C(q, qd) qd = tau``, and of rigid bodies.

The physics is one, its forms are several, and each is here once. A simulation of effects adds to inertia and torque and
needs them apart (`Turning`); a controlled plant may be known by its torque alone (`RotationalPlant`); predictors are
replayed many at a time and may have an inertia that no body has (`AccelerationLaw`); a noisy flight is balanced without
differentiating its rates (`momentum_form`). They agree to rounding, but not digit by digit, and artifacts are compared
byte by byte: so none is computed from another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics.rigid_body import newton_euler_torque, positive_definite
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import InertiaValues

# Below this |cos(pitch)| half of all digits are lost to the singularity of the Euler angles.
_STEEP = 1e-8


class InertiaModel(Protocol):
    """A model that knows the generalised inertia matrix and its gradient."""

    def inertia(self, attitude: Array) -> InertiaValues:
        """Evaluate J(q) and its gradient."""
        ...

    def corrected(self, added: Array) -> InertiaModel:
        """Add an inertia tensor, shape (3, 3), kg m^2, body frame."""
        ...

    def outside(self, attitude: Array) -> BoolArray:
        """Flag attitudes that it was not found at, shape (samples,)."""
        ...


class TorqueModel(Protocol):
    """A model that knows the generalised torque of a motion, ``D(q) qdd + C(q, qd) qd``."""

    def torque(self, motion: Motion) -> Array:
        """Evaluate the generalised torque, shape (samples, 3), N m."""
        ...


@dataclass(frozen=True)
class RigidBody:
    """A rigid body as a torque model.

    Attributes
    ----------
    inertia : array, shape (3, 3), kg m^2, body frame
    """

    inertia: Array

    def torque(self, motion: Motion) -> Array:
        """Compute the generalised torque, shape (samples, 3), N m."""
        return newton_euler_torque(motion.attitude, motion.rate, motion.acceleration, self.inertia)


def coriolis_matrix(inertia: InertiaValues, rate: Array) -> Array:
    """Build C(q, qd) from the gradient of the inertia matrix.

    ``C_ij = 1/2 sum_k (dJ_ij/dq_k + dJ_ik/dq_j - dJ_jk/dq_i) qd_k``

    Parameters
    ----------
    rate : array, shape (samples, 3), rad/s

    Returns
    -------
    array, shape (samples, 3, 3), kg m^2/s

    References
    ----------
    Equation (4).
    """
    along = np.einsum("nkij,nk->nij", inertia.gradient, rate)
    towards = np.einsum("njik,nk->nij", inertia.gradient, rate)
    return np.asarray(0.5 * (along + towards - towards.swapaxes(1, 2)))


def momentum_form(attitude: Array, body_rate: Array, inertia: InertiaValues) -> tuple[Array, Array]:
    """Write the body torque of a model as ``d/dt momentum + direct``, so that no rate has to be differentiated.

    ``W^-T (d/dt (J qd) - 1/2 grad (qd^T J qd))``, with W^-T taken under the derivative.

    Parameters
    ----------
    attitude : array, shape (samples, 3), rad
    body_rate : array, shape (samples, 3), rad/s, body frame
    inertia : InertiaValues
        At these attitudes.

    Returns
    -------
    momentum, direct : array, shape (samples, 3), N m s and N m, body frame
    """
    rate = rotations.attitude_rate(attitude, body_rate)
    generalised = rotations.multiply(inertia.value, rate)
    momentum = rotations.body_torque(attitude, generalised)
    # W^-T h' = d/dt (W^-T h) + W^-T W'^T (W^-T h), since the derivative of W^-T is -W^-T W'^T W^-T.
    turning = rotations.multiply(rotations.euler_rate_matrix_derivative(attitude, rate).swapaxes(1, 2), momentum)
    potential = 0.5 * np.einsum("nkij,ni,nj->nk", inertia.gradient, rate, rate)
    return momentum, rotations.body_torque(attitude, turning - potential)


class Turning(NamedTuple):
    """The torque that a motion takes, ``inertia omega' + direct``.

    Attributes
    ----------
    inertia : array, shape (3, 3), kg m^2, body frame
    direct : array, shape (3,), N m, body frame
    """

    inertia: Array
    direct: Array


TurningLaw = Callable[[Array, Array], Turning]
"""Takes attitude and body rate, shape (3,) each."""


def rigid_turning(inertia: Array) -> TurningLaw:
    """Make the turning law of a rigid body, ``I omega' + omega x I omega``.

    Parameters
    ----------
    inertia : array, shape (3, 3), kg m^2, body frame
    """
    return lambda _attitude, body_rate: Turning(inertia, rotations.cross(body_rate, inertia @ body_rate))


def identified_turning(model: InertiaModel) -> TurningLaw:
    """Make the turning law of a model in Euler coordinates, ``J qdd + (dJ/dt) qd - 1/2 grad (qd^T J qd)``.

    With ``omega = W qd`` its inertia in body axes is ``W^-T J W^-1``, and the rest is ``W^-T ((dJ/dt) qd -
    1/2 grad (qd^T J qd) - J W^-1 (dW/dt) qd)``.
    """

    def turning(attitude: Array, body_rate: Array) -> Turning:
        q = attitude[None]
        inverse = np.linalg.inv(rotations.euler_rate_matrix(q)[0])
        rate = inverse @ body_rate
        values = model.inertia(q)
        inertia, gradient = values.value[0], values.gradient[0]
        along = np.einsum("kij,k,j->i", gradient, rate, rate) - 0.5 * np.einsum("kij,i,j->k", gradient, rate, rate)
        winding = inverse @ rotations.euler_rate_matrix_derivative(q, rate[None])[0] @ rate
        return Turning(inverse.T @ inertia @ inverse, inverse.T @ (along - inertia @ winding))

    return turning


RotationalPlant = Callable[[Array, Array, Array], Array]
"""Takes attitude, body rate and body torque, shape (vehicle, 3) each; gives the derivative of the body rate."""


def rigid_plant(inertia: Array) -> RotationalPlant:
    """Make the plant of a rigid body, ``I omega' = M - omega x I omega``.

    Parameters
    ----------
    inertia : array, shape (3, 3), kg m^2, body frame
    """
    inverse = np.linalg.inv(inertia)

    def derivative(_attitude: Array, body_rate: Array, body_torque: Array) -> Array:
        p, q, r = body_rate.T
        x, y, z = (body_rate @ inertia).T
        gyroscopic = np.array([q * z - r * y, r * x - p * z, p * y - q * x]).T
        return np.asarray((body_torque - gyroscopic) @ inverse)

    return derivative


def model_plant(model: TorqueModel) -> RotationalPlant:
    """Make the plant of a model in Euler coordinates, ``D(q) qdd = W^T M - C(q, qd) qd``.

    What it gives is not finite where the model has no inertia to turn.
    """

    def derivative(attitude: Array, body_rate: Array, body_torque: Array) -> Array:
        rate = rotations.attitude_rate(attitude, body_rate)
        still, units = np.zeros_like(rate), [np.broadcast_to(axis, rate.shape) for axis in np.eye(3)]
        # One call for C qd and the three columns of D: the model has more to do once than for each sample.
        rates, accelerations = np.concatenate([rate, still, still, still]), np.concatenate([still, *units])
        torques = model.torque(Motion(np.tile(attitude, (4, 1)), rates, accelerations)).reshape(4, -1, 3)
        inertia = np.stack([torques[1], torques[2], torques[3]], axis=2)
        needed = rotations.generalised_torque(attitude, body_torque) - torques[0]
        return rotations.body_acceleration(attitude, rate, _solved_or_nan(inertia, needed))

    return derivative


def _solved_or_nan(inertia: Array, torque: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(inertia, torque[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.full_like(torque, np.nan)


class RotationState(NamedTuple):
    """Attitude and body rate of bodies that run freely.

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


AccelerationLaw = Callable[[RotationState, Array], Acceleration]
"""Takes bodies and the torques on them, shape (bodies, 3), N m, body frame."""

Predictor = InertiaModel | Array
"""A model in Euler coordinates, or the six inertia parameters of a rigid body, shape (6,), kg m^2."""


def acceleration_law(predictor: Predictor) -> AccelerationLaw:
    """Make the equation of motion of a predictor, for many bodies at once."""
    return _rigid(symmetric(predictor)) if isinstance(predictor, np.ndarray) else _identified(predictor)


def _rigid(inertia: Array) -> AccelerationLaw:
    """Make the law ``I omega' = M - omega x I omega``."""

    def law(state: RotationState, torque: Array) -> Acceleration:
        matrices = np.broadcast_to(inertia, (len(torque), 3, 3))
        return _solved(matrices, torque - np.cross(state.body_rate, state.body_rate @ inertia))

    return law


def _identified(model: InertiaModel) -> AccelerationLaw:
    """Make the law ``J qdd = W^T M - (dJ/dt) qd + 1/2 grad (qd^T J qd)``, ``omega' = W qdd + (dW/dt) qd``."""

    def law(state: RotationState, torque: Array) -> Acceleration:
        q = _attitude(state)
        steep = np.abs(np.cos(q[:, 1])) < _STEEP
        q = np.where(steep[:, None], 0.0, q)
        qd = rotations.attitude_rate(q, state.body_rate)
        values = model.inertia(q)
        along = np.einsum("nkij,nk,nj->ni", values.gradient, qd, qd)
        potential = 0.5 * np.einsum("nkij,ni,nj->nk", values.gradient, qd, qd)
        qdd = _solved(values.value, rotations.generalised_torque(q, torque) - along + potential)
        return Acceleration(rotations.body_acceleration(q, qd, qdd.value), qdd.exists & ~steep)

    return law


def _attitude(state: RotationState) -> Array:
    """Compute the Euler angles on the side of the vertical that the pitch is counted on."""
    near = rotations.euler_angles(state.rotation)
    return np.where(state.beyond[:, None], np.pi + near * [1.0, -1.0, 1.0], near)


def _solved(matrices: Array, right_side: Array) -> Acceleration:
    exists = positive_definite(matrices)
    safe = np.where(exists[:, None, None], matrices, np.eye(3))
    value = np.linalg.solve(safe, np.where(exists[:, None], right_side, 0.0)[..., None])[..., 0]
    return Acceleration(value, exists)
