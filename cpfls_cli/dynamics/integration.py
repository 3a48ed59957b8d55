"""Rotation integrated in time: one step of Runge and Kutta's method, and the runs that take it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics.equations_of_motion import Turning, TurningLaw
from cpfls_cli.dynamics.rigid_body import positive_definite

# The error of a step of the classic Runge-Kutta method that turns by x is of the order x^5 / 120: 1e-7 rad here.
_TURN_PER_STEP = 0.1
# Far beyond it the method does not follow any motion; the run is lost.
_LARGEST_TURN = 1.0
_MOST_STEPS = 20


def runge_kutta_step(
    slope: Callable[[Array, Array], Array],
    state: Array,
    torque: tuple[Array, Array, Array],
    step: float | Array,
) -> Array:
    """Take one step of the classic Runge-Kutta method of fourth order.

    Parameters
    ----------
    slope : callable
        Differentiates a state by time under a torque.
    state : array
        At the begin of the step.
    torque : tuple of array, shape (bodies, 3), N m, body frame
        At the begin, in the middle and at the end of the step.
    step : float or array, s

    References
    ----------
    Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, table 1.2 of section II.1.
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
