"""What a vehicle model does: accelerations, one step forward, and the rotor speeds that give a wanted wrench.

The compiled loops of `cpfls_cli.playback.kernels` take the same step along flights; here it is written for states that
stand side by side, and for those who want to read it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.rotations import turns
from cpfls_cli.vehicle.rotors import rotor_demand

_STEPS = 40
"""Of Newton's method at most: few are needed but where steps are cut short (`_SLOWEST`)."""

_SLOWEST = 0.2
"""Share of a speed that one step of Newton's method leaves of it at least, so that it stays above zero."""

_MET = 1e-10
"""Share of the sizes of its terms up to which what is left of a balance is rounding."""

_ROUNDING = 1e-12
"""Share by which a speed at its limit may lie above it."""

_SMALL = 1e-4
"""Least share of the largest squared speed that a rotor starts from."""


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


def rotor_speeds(
    model: VehicleModel, velocity: Array, rate: Array, thrust: Array, torque: Array, slow: Array | None = None
) -> Array:
    """Compute the steady rotor speeds that give a wanted thrust and torque at a state.

    Newton's method on the speeds of all samples at once, from those that the rotors alone would need; with more than
    four rotors its steps are the shortest ones.

    Parameters
    ----------
    velocity : array, shape (time, 3), m/s, body frame
        Through the air.
    rate : array, shape (time, 3), rad/s, body frame
    thrust : array, shape (time,), N
        Force along body z, of rotors and all effects together.
    torque : array, shape (time, 3), N m, body frame
        Of rotors and all effects together.
    slow : array, shape (time, rotor), rad^2/s^2, or None
        Squared speeds behind which slow actuation is; None for actuation that has settled.

    Returns
    -------
    array, shape (time, rotor), rad/s
        NaN where no speeds that the rotors can turn at give this.

    Raises
    ------
    ComputationError
        If the rotors cannot produce thrust, roll, pitch and yaw independently.
    """
    wanted = np.column_stack([thrust, torque])
    known = np.isfinite(np.column_stack([wanted, velocity, rate, *([] if slow is None else [slow])])).all(axis=1)
    speed = np.full((len(wanted), model.rotors), np.nan)
    if known.any():
        settled = np.zeros((len(wanted), model.rotors)) if slow is None else slow
        balance = _Balance.of(model, velocity[known], rate[known], wanted[known], settled[known], slow is None)
        start = np.maximum(rotor_demand(model.vehicle, thrust[known], torque[known]).squared_speed, 0.0)
        # From standstill no speed has an effect, and Newton's method would stay there.
        speed[known] = _newton(balance, np.sqrt(np.maximum(start, _SMALL * start.max(axis=1, keepdims=True))))
    highest = model.vehicle.rotor_speed_max_rad_s * (1 + _ROUNDING)
    speed[np.any(speed > highest, axis=1)] = np.nan
    return speed


class _Balance(NamedTuple):
    """Thrust and torque over rotor speeds, less what is wanted: ``constant + linear w + square w^2``."""

    constant: Array
    linear: Array
    square: Array
    size: Array

    @classmethod
    def of(
        cls, model: VehicleModel, velocity: Array, rate: Array, wanted: Array, slow: Array, settled: bool
    ) -> _Balance:
        rotors = model.rotors
        by_rotor = model.table.by_rotor_term(velocity, rate)[:, [5, 0, 1, 2]]
        linear, square, _, late = (by_rotor[:, :, 1 + k * rotors : 1 + (k + 1) * rotors] for k in range(4))
        constant = by_rotor[:, :, 0] - wanted + np.einsum("nkr,nr->nk", late, slow)
        square = square if settled else square - late
        size = np.abs(by_rotor[:, :, 0]) + np.abs(wanted)
        return cls(constant, linear, square, size)

    def left(self, speed: Array) -> Array:
        """Compute what is left of the balance, shape (time, 4)."""
        moved = self.linear * speed[:, None] + self.square * speed[:, None] ** 2
        return np.asarray(self.constant + moved.sum(axis=2))

    def slope(self, speed: Array) -> Array:
        """Differentiate it by the speeds, shape (time, 4, rotor)."""
        return np.asarray(self.linear + 2.0 * self.square * speed[:, None])

    def met(self, speed: Array) -> BoolArray:
        """Tell where nothing is left but rounding."""
        terms = np.abs(self.linear * speed[:, None]) + np.abs(self.square * speed[:, None] ** 2)
        return np.asarray(np.all(np.abs(self.left(speed)) <= _MET * (self.size + terms.sum(axis=2)), axis=1))


def _newton(balance: _Balance, speed: Array) -> Array:
    """Solve a balance by Newton's method; NaN where it does not come to an end."""
    for _ in range(_STEPS):
        slope, left = balance.slope(speed), balance.left(speed)
        # Yaw is weaker than thrust by orders of magnitude; rows of equal length keep its share of the step.
        length = np.linalg.norm(slope, axis=2)
        length = np.where(length > 0, length, 1.0)
        change = np.linalg.pinv(slope / length[:, :, None]) @ (left / length)[:, :, None]
        speed = np.maximum(speed - change[:, :, 0], _SLOWEST * speed)
        if balance.met(speed).all():
            break
    return np.where(balance.met(speed)[:, None], speed, np.nan)
