"""Inertial torque and force in momentum form, so that no rate has to be differentiated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.equations_of_motion import InertiaModel, momentum_form
from cpfls_cli.dynamics.rigid_body import inertia_tensor
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError


@dataclass(frozen=True)
class Balance:
    """One side of a balance, ``d/dt momentum + direct``.

    Attributes
    ----------
    momentum, direct : array, shape (time, 3), body axes
    """

    momentum: Array
    direct: Array


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
    return Balance(*momentum_form(attitude, signals.body_rate, model.inertia(attitude)))


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
