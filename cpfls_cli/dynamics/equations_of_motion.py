"""Equations of rotation: of models in Euler coordinates, ``J(q) qdd + C(q, qd) qd = tau``, and of rigid bodies.

What turns, whether flown with effects or replayed, turns by one law (`turning_law`), which keeps inertia
and torque apart; a noisy flight is balanced without differentiating its rates (`momentum_form`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.inertia import symmetric
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
    """The torque that motions take, ``inertia omega' + direct``.

    Attributes
    ----------
    inertia : array, shape (bodies, 3, 3), kg m^2, body frame
    direct : array, shape (bodies, 3), N m, body frame
    """

    inertia: Array
    direct: Array

    def acceleration(self, torque: Array) -> Array:
        """Compute what torques, shape (bodies, 3), N m, do to the body rates; NaN where there is nothing to turn."""
        known: BoolArray = np.asarray(np.isfinite(self.inertia).all(axis=(1, 2)))
        size = np.linalg.det(np.where(known[:, None, None], self.inertia, 0.0))
        solvable: BoolArray = np.asarray(known & (size != 0))
        found = np.full_like(self.direct, np.nan)
        left = (torque - self.direct)[solvable]
        found[solvable] = np.linalg.solve(self.inertia[solvable], left[..., None])[..., 0]
        return found


TurningLaw = Callable[[Array, Array], Turning]
"""Takes attitude and body rate, shape (bodies, 3) each."""

Predictor = InertiaModel | Array
"""A model in Euler coordinates, or the six inertia parameters of a rigid body, shape (6,), kg m^2."""


def turning_law(model: Predictor) -> TurningLaw:
    """Make the law by which bodies turn: of a model, or of a rigid body, ``I omega' + omega x I omega``."""
    if not isinstance(model, np.ndarray):
        return _identified(model)
    inertia = symmetric(model)

    def law(_attitude: Array, body_rate: Array) -> Turning:
        return Turning(
            np.broadcast_to(inertia, (len(body_rate), 3, 3)), rotations.cross(body_rate, body_rate @ inertia)
        )

    return law


def _identified(model: InertiaModel) -> TurningLaw:
    """Make the law of a model in Euler coordinates, ``J qdd + (dJ/dt) qd - 1/2 grad (qd^T J qd)``.

    With ``omega = W qd`` its inertia in body axes is ``W^-T J W^-1``, NaN at the vertical, and the rest is ``W^-T
    ((dJ/dt) qd - 1/2 grad (qd^T J qd) - J W^-1 (dW/dt) qd)``.
    """

    def law(attitude: Array, body_rate: Array) -> Turning:
        steep = np.abs(np.cos(attitude[:, 1])) < _STEEP
        q = np.where(steep[:, None], 0.0, attitude)
        values, inertia = body_inertia(model, q)
        qd = rotations.attitude_rate(q, body_rate)
        along = np.einsum("nkij,nk,nj->ni", values.gradient, qd, qd)
        potential = 0.5 * np.einsum("nkij,ni,nj->nk", values.gradient, qd, qd)
        winding = rotations.attitude_rate(q, rotations.multiply(rotations.euler_rate_matrix_derivative(q, qd), qd))
        direct = rotations.body_torque(q, along - potential - rotations.multiply(values.value, winding))
        return Turning(np.where(steep[:, None, None], np.nan, inertia), direct)

    return law


def body_inertia(model: InertiaModel, attitude: Array) -> tuple[InertiaValues, Array]:
    """Evaluate an inertia on Euler angles, and about the body axes, ``W^-T J W^-1``, shape (samples, 3, 3), kg m^2."""
    values = model.inertia(attitude)
    axes = rotations.attitude_rate(attitude, np.broadcast_to(np.eye(3)[:, None], (3, *attitude.shape)))
    inverse = np.ascontiguousarray(axes.transpose(1, 2, 0))
    return values, np.asarray(inverse.swapaxes(1, 2) @ values.value @ inverse)
