"""Equations of rotation: of models in Euler coordinates, ``J(q) qdd + C(q, qd) qd = tau``, and of rigid bodies.

What turns, whether flown with effects or replayed, turns by one law (`turning_law`), which keeps inertia
and torque apart; a noisy flight is balanced without differentiating its rates (`momentum_form`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple, Protocol

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics.rigid_body import positive_definite
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import InertiaValues

# Below this |cos(pitch)| half of all digits are lost to the singularity of the Euler angles.
_STEEP = 1e-8
# The error of a step of the classic Runge-Kutta method that turns by x is of the order x^5 / 120: 1e-7 rad here.
_TURN_PER_STEP = 0.1
# Far beyond it the method does not follow any motion; the run is lost.
_LARGEST_TURN = 1.0
_MOST_STEPS = 20


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
    """The torque that motions take, ``inertia omega' + direct``, kg m^2 and N m in the body frame."""

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


def runge_kutta_step(
    slope: Callable[[Array, Array], Array],
    state: Array,
    torque: tuple[Array, Array, Array],
    step: float | Array,
) -> Array:
    """Take one step of the classic Runge-Kutta method of fourth order.

    `slope` differentiates a state by time under a torque; those of the step are at its begin, middle and end, N m in
    the body frame. Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, table 1.2 of section II.1.
    """
    begin, middle, end = torque
    first = slope(state, begin)
    second = slope(state + 0.5 * step * first, middle)
    third = slope(state + 0.5 * step * second, middle)
    fourth = slope(state + step * third, end)
    return np.asarray(state + step / 6 * (first + 2 * (second + third) + fourth))


class RotationState(NamedTuple):
    """Attitude and body rate of bodies that run freely; NaN from where on a run is lost.

    Attributes
    ----------
    rotation : array, shape (bodies, 3, 3)
        Body to world.
    body_rate : array, shape (bodies, 3), rad/s, body frame
    """

    rotation: Array
    body_rate: Array


def free_runs(
    law: TurningLaw, start: RotationState, beyond: BoolArray, time: Array, torque: Array, fastest: float
) -> Iterator[RotationState]:
    """Integrate free runs under torques that are known at samples, ``R' = R [omega]_x`` and ``omega'`` by the law.

    Each sample is integrated in as many steps as keep each turn below 0.1 rad. Between samples the torque is a straight
    line. A run is lost where the inertia is not positive definite, because no torque turns such a body, or where it
    turns faster than any step can follow.

    Parameters
    ----------
    beyond : array of bool, shape (run,)
        Whether the pitch is counted beyond +-90 degrees. Every attitude has Euler angles on both sides, and a model
        of the full circle has learned from those of the flight.
    time : array, shape (run, sample), s
    torque : array, shape (run, sample, 3), N m, body frame
    fastest : float, rad/s
        Body rate that the steps are made for.

    Yields
    ------
    RotationState
        Sample after sample, from the first one behind the start.
    """
    interval = np.diff(time, axis=1)
    steps = int(np.clip(np.ceil(fastest * np.max(interval, initial=0.0) / _TURN_PER_STEP), 1, _MOST_STEPS))
    state = np.concatenate([start.rotation.reshape(-1, 9), start.body_rate], axis=1)
    for sample in range(interval.shape[1]):
        begin, change = torque[:, sample], np.diff(torque[:, sample : sample + 2], axis=1)[:, 0]
        step = interval[:, sample, None] / steps

        def slope(state: Array, torque: Array, step: Array = step) -> Array:
            rotation, body_rate = _split(state)
            slow = np.linalg.norm(body_rate, axis=1) * step[:, 0] < _LARGEST_TURN
            rate = np.where(slow[:, None], body_rate, np.nan)
            turning = law(_attitude(rotation, beyond), rate)
            turned = Turning(_definite(turning.inertia), turning.direct).acceleration(torque)
            # R [rate]_x is row by row a cross product with the rate.
            return np.concatenate([rotations.cross(rotation, rate[:, None]).reshape(-1, 9), turned], axis=1)

        for part in range(steps):
            first, last = begin + change * (part / steps), begin + change * ((part + 1) / steps)
            state = runge_kutta_step(slope, state, (first, 0.5 * (first + last), last), step)
        yield RotationState(*_split(state))


def _split(state: Array) -> tuple[Array, Array]:
    return state[:, :9].reshape(-1, 3, 3), state[:, 9:]


def _definite(inertia: Array) -> Array:
    return np.where(positive_definite(inertia)[:, None, None], inertia, np.nan)


def _attitude(rotation: Array, beyond: BoolArray) -> Array:
    """Compute the Euler angles on the side of the vertical that the pitch is counted on; any of a run that is lost."""
    near = rotations.euler_angles(np.nan_to_num(rotation))
    return np.where(beyond[:, None], np.pi + near * [1.0, -1.0, 1.0], near)
