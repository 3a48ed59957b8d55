"""Inertial torque and force in momentum form, so that no rate has to be differentiated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.regressor.regressor import InertiaValues
from cpfls_cli.vehicle.rigid_body import inertia_tensor


@dataclass(frozen=True)
class Balance:
    """One side of a balance, ``d/dt momentum + direct``.

    Attributes
    ----------
    momentum, direct : array, shape (time, 3), body axes
    """

    momentum: Array
    direct: Array


class InertiaModel(Protocol):
    """A model that knows the generalised inertia matrix and its gradient."""

    def inertia(self, attitude: Array) -> InertiaValues:
        """Evaluate J(q) and its gradient."""
        ...


def rotation_balance(signals: Signals, model: InertiaModel | None = None) -> Balance:
    """Compute the inertial body torque in momentum form.

    A rigid body: momentum ``I omega``, direct ``omega x I omega``. A model in Euler coordinates: ``W^-T (d/dt (J qd) -
    1/2 grad (qd^T J qd))``, with W^-T taken under the derivative.

    Parameters
    ----------
    signals : Signals
    model : InertiaModel or None
        None for the rigid body of the vehicle.

    Returns
    -------
    Balance
        N m s and N m.

    Raises
    ------
    InputError
        If the model needs an attitude that the flight lacks.
    """
    if model is not None:
        return _euler_balance(signals, model)
    momentum = signals.body_rate @ inertia_tensor(signals.vehicle)
    return Balance(momentum, np.cross(signals.body_rate, momentum))


def _euler_balance(signals: Signals, model: InertiaModel) -> Balance:
    attitude = signals.attitude
    if attitude is None:
        raise InputError("the model needs the attitude, which the flight lacks")
    rate = rotations.attitude_rate(attitude, signals.body_rate)
    inertia = model.inertia(attitude)
    generalised = rotations.multiply(inertia.value, rate)
    momentum = rotations.body_torque(attitude, generalised)
    # W^-T h' = d/dt (W^-T h) + W^-T W'^T (W^-T h), since the derivative of W^-T is -W^-T W'^T W^-T.
    turning = rotations.multiply(rotations.euler_rate_matrix_derivative(attitude, rate).swapaxes(1, 2), momentum)
    potential = 0.5 * np.einsum("nkij,ni,nj->nk", inertia.gradient, rate, rate)
    return Balance(momentum, rotations.body_torque(attitude, turning - potential))


def translation_balance(signals: Signals) -> Balance:
    """Compute mass times specific force in momentum form, body axes.

    From the accelerometer, else from the acceleration, else from the velocity: ``d/dt (m v_b) + m omega x v_b +
    m g R^T e_z``.

    Parameters
    ----------
    signals : Signals
        With `has_force`.

    Returns
    -------
    Balance
        N s and N.
    """
    mass, gravity = signals.vehicle.mass_kg, signals.vehicle.gravity_m_s2
    if signals.specific_force is not None:
        return Balance(np.zeros((len(signals), 3)), mass * signals.specific_force)
    weight = mass * gravity * signals.rotation[:, 2]
    if signals.acceleration is not None:
        felt = np.einsum("tji,tj->ti", signals.rotation, signals.acceleration)
        return Balance(np.zeros((len(signals), 3)), mass * felt + weight)
    momentum = mass * signals.air_velocity
    return Balance(momentum, np.cross(signals.body_rate, momentum) + weight)
