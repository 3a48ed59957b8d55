"""How a body turns under a torque: as a rigid body, or as an identified model has it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.regressor.regressor import InertiaValues


class InertiaModel(Protocol):
    """A model that knows the generalised inertia matrix and its gradient."""

    def inertia(self, attitude: Array) -> InertiaValues:
        """Evaluate J(q) and its gradient."""
        ...


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
    """Turn as a rigid body does, ``I omega' + omega x I omega``.

    Parameters
    ----------
    inertia : array, shape (3, 3), kg m^2, body frame
    """
    return lambda _attitude, body_rate: Turning(inertia, np.cross(body_rate, inertia @ body_rate))


def identified_turning(model: InertiaModel) -> TurningLaw:
    """Turn as a model in Euler coordinates does, ``J qdd + (dJ/dt) qd - 1/2 grad (qd^T J qd)``.

    With ``omega = W qd`` its inertia in body axes is ``W^-T J W^-1``, and what is left is ``W^-T ((dJ/dt) qd -
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
