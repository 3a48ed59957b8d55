"""The spherical pendulum under a moving hook, in plain numbers: arrays of three would cost ten times as much."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.arrays import Array

_Vector = Sequence[float]
_State = tuple[float, float, float, float, float, float]


def integrate(
    nodes: Sequence[_Vector], middles: Sequence[_Vector], step: float, length: float, damping: float
) -> Array:
    """Integrate direction and rate of a cable from rest by the classical Runge-Kutta method.

    Parameters
    ----------
    nodes : sequence of three numbers, m/s^2
        Acceleration of the hook plus gravity at each step, world frame.
    middles : sequence of three numbers, m/s^2
        Half a step later; one fewer.
    step : float, s
    length : float, m
    damping : float, 1/s

    Returns
    -------
    array, shape (step, 6)
        Direction, then rate in 1/s.
    """
    state: _State = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)
    states = [state]
    for number, middle in enumerate(middles):
        half = 0.5 * step
        first = _rate(state, nodes[number], length, damping)
        second = _rate(_moved(state, first, half), middle, length, damping)
        third = _rate(_moved(state, second, half), middle, length, damping)
        fourth = _rate(_moved(state, third, step), nodes[number + 1], length, damping)
        mean = tuple((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(first, second, third, fourth, strict=True))
        state = _unit(_moved(state, mean, step))
        states.append(state)
    return np.array(states)


def _rate(state: Sequence[float], felt: _Vector, length: float, damping: float) -> _State:
    x, y, z, u, v, w = state
    a, b, c = felt
    along = a * x + b * y + c * z
    centripetal = u * u + v * v + w * w
    return (
        u,
        v,
        w,
        -(a - x * along) / length - centripetal * x - damping * u,
        -(b - y * along) / length - centripetal * y - damping * v,
        -(c - z * along) / length - centripetal * z - damping * w,
    )


def _moved(state: Sequence[float], rate: Sequence[float], step: float) -> tuple[float, ...]:
    return tuple(value + step * change for value, change in zip(state, rate, strict=True))


def _unit(state: Sequence[float]) -> _State:
    """Bring the direction back to length 1 and its rate across it, which rounding spoils."""
    x, y, z, u, v, w = state
    scale = 1.0 / (x * x + y * y + z * z) ** 0.5
    x, y, z = x * scale, y * scale, z * scale
    along = u * x + v * y + w * z
    return x, y, z, u - along * x, v - along * y, w - along * z
