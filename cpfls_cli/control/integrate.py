"""The motion from one command to the next."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, exp

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.control.plants import Plant

_ROUNDING = 1e-6


@dataclass(frozen=True)
class Actuators:
    """How a command becomes a torque.

    Attributes
    ----------
    time_constant : float, s
        Of a first-order lag; 0 for none.
    torque_max : array, shape (3,), or None, N m, body frame
        Commands are clipped to it; None for no limit.
    """

    time_constant: float = 0.0
    torque_max: Array | None = None

    def clipped(self, command: Array) -> Array:
        """Clip commands, shape (vehicle, 3), N m, to what the actuators can do."""
        return command if self.torque_max is None else np.clip(command, -self.torque_max, self.torque_max)

    def torque(self, before: Array, command: Array, after: float) -> Array:
        """Compute the torque some time after a command, ``c + (before - c) exp(-t / T)``.

        Parameters
        ----------
        before, command : array, shape (vehicle, 3), N m
        after : float, s

        Returns
        -------
        array, shape (vehicle, 3), N m
        """
        if self.time_constant == 0:
            return command
        return np.asarray(command + (before - command) * exp(-after / self.time_constant))


def advance(plant: Plant, state: Array, torque: Callable[[float], Array], period: float, steps: int) -> Array:
    """Integrate attitude and body rate over one period of control, by Runge and Kutta's method of fourth order.

    Parameters
    ----------
    plant : callable
    state : array, shape (vehicle, 6)
        Attitude in rad, body rate in rad/s.
    torque : callable
        Body torque, shape (vehicle, 3), by the time since the command in s.
    period : float, s
    steps : int
        Of the integration.

    Returns
    -------
    array, shape (vehicle, 6)
    """
    step = period / steps
    for number in range(steps):
        begin = number * step
        middle = torque(begin + 0.5 * step)
        first = _derivative(plant, state, torque(begin))
        second = _derivative(plant, state + 0.5 * step * first, middle)
        third = _derivative(plant, state + 0.5 * step * second, middle)
        fourth = _derivative(plant, state + step * third, torque(begin + step))
        state = state + step / 6 * (first + 2 * (second + third) + fourth)
    return state


def steps_of(period: float, rate: float, time_constant: float) -> int:
    """Count the steps of the integration in one period of control, two or more in the time constant of a lag.

    Parameters
    ----------
    period : float, s
    rate : float, Hz
        Of the steps, at least.
    time_constant : float, s
        0 for none.
    """
    fastest = max(rate, 2 / time_constant if time_constant > 0 else 0.0)
    return max(ceil(period * fastest - _ROUNDING), 1)


def _derivative(plant: Plant, state: Array, torque: Array) -> Array:
    attitude, body_rate = state[:, :3], state[:, 3:]
    rate = rotations.attitude_rate(attitude, body_rate)
    return np.concatenate([rate, plant(attitude, body_rate, torque)], axis=1)
