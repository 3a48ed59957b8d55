"""Rotation integrated in time: one step of Runge and Kutta's method, and the two kinds of runs that take it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics.equations_of_motion import AccelerationLaw, RotationalPlant, RotationState

# The error of a step of the classic Runge-Kutta method that turns by x is of the order x^5 / 120: 1e-7 rad here.
_TURN_PER_STEP = 0.1
# Far beyond it the method does not follow any motion; the run is lost.
_LARGEST_TURN = 1.0
_MOST_STEPS = 20

State = TypeVar("State")
Slope = TypeVar("Slope")


class Equation(Protocol[State, Slope]):
    """An equation of motion over one step of time, with the arithmetic of its state.

    The step belongs to all equations, the sum of its slopes to each: Euler angles and rotation matrices add
    them up in different orders, the last digit of a result depends on it, and artifacts are compared byte by byte.
    """

    def slope(self, state: State, torque: Array) -> Slope:
        """Differentiate a state by time under a torque."""
        ...

    def moved(self, state: State, slope: Slope, share: float) -> State:
        """Move a state along a slope for a share of the step."""
        ...

    def joined(self, state: State, slopes: tuple[Slope, Slope, Slope, Slope]) -> State:
        """Move a state for the whole step, ``(k1 + 2 k2 + 2 k3 + k4) / 6``."""
        ...


def runge_kutta_step(equation: Equation[State, Slope], state: State, torque: tuple[Array, Array, Array]) -> State:
    """Take one step of the classic Runge-Kutta method of fourth order.

    Parameters
    ----------
    state : State
        At the begin of the step.
    torque : tuple of array, shape (bodies, 3), N m, body frame
        At the begin, in the middle and at the end of the step.

    References
    ----------
    Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, table 1.2 of section II.1.
    """
    begin, middle, end = torque
    first = equation.slope(state, begin)
    second = equation.slope(equation.moved(state, first, 0.5), middle)
    third = equation.slope(equation.moved(state, second, 0.5), middle)
    fourth = equation.slope(equation.moved(state, third, 1.0), end)
    return equation.joined(state, (first, second, third, fourth))


def advance(plant: RotationalPlant, state: Array, torque: Callable[[float], Array], period: float, steps: int) -> Array:
    """Integrate attitude and body rate over one period of control.

    Parameters
    ----------
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
    equation = _EulerAngles(plant, step)
    for number in range(steps):
        begin = number * step
        state = runge_kutta_step(equation, state, (torque(begin), torque(begin + 0.5 * step), torque(begin + step)))
    return state


@dataclass(frozen=True)
class _EulerAngles:
    """Attitude and body rate in one array, shape (vehicle, 6)."""

    plant: RotationalPlant
    step: float

    def slope(self, state: Array, torque: Array) -> Array:
        attitude, body_rate = state[:, :3], state[:, 3:]
        rate = rotations.attitude_rate(attitude, body_rate)
        return np.concatenate([rate, self.plant(attitude, body_rate, torque)], axis=1)

    def moved(self, state: Array, slope: Array, share: float) -> Array:
        return state + share * self.step * slope

    def joined(self, state: Array, slopes: tuple[Array, Array, Array, Array]) -> Array:
        first, second, third, fourth = slopes
        return state + self.step / 6 * (first + 2 * (second + third) + fourth)


def free_runs(
    law: AccelerationLaw, start: RotationState, time: Array, torque: Array, fastest: float
) -> Iterator[RotationState]:
    """Integrate free runs under torques that are known at samples, ``R' = R [omega]_x`` and ``omega'`` by the law.

    Each sample is integrated in as many steps as keep each turn below 0.1 rad. Between samples the torque is a straight
    line. A run is lost where the inertia is not positive definite, or where it turns faster than any step can follow.

    Parameters
    ----------
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
    state = start
    for sample in range(interval.shape[1]):
        begin, change = torque[:, sample], np.diff(torque[:, sample : sample + 2], axis=1)[:, 0]
        equation = _RotationMatrices(law, interval[:, sample, None] / steps)
        for step in range(steps):
            ends = begin + change * (step / steps), begin + change * ((step + 1) / steps)
            state = runge_kutta_step(equation, state, (ends[0], 0.5 * (ends[0] + ends[1]), ends[1]))
        yield state


class _RotationSlope(NamedTuple):
    """Derivatives of rotation and body rate, and whether all that led to them exists."""

    rotation: Array
    body_rate: Array
    exists: BoolArray


@dataclass(frozen=True)
class _RotationMatrices:
    """Rotation matrices and body rates of runs that may be lost; the steps have shape (bodies, 1), s."""

    law: AccelerationLaw
    step: Array

    def slope(self, state: RotationState, torque: Array) -> _RotationSlope:
        acceleration = self.law(state, torque)
        # R [rate]_x is row by row a cross product with the rate.
        turning = np.cross(state.rotation, state.body_rate[:, None])
        return _RotationSlope(turning, acceleration.value, state.exists & acceleration.exists)

    def moved(self, state: RotationState, slope: _RotationSlope, share: float) -> RotationState:
        """Move on; a body that would turn too far in a step stays, and is lost."""
        interval = share * self.step
        body_rate = state.body_rate + interval * slope.body_rate
        exists = slope.exists & (np.linalg.norm(body_rate, axis=1) * interval[:, 0] < _LARGEST_TURN)
        rotation = state.rotation + interval[:, :, None] * slope.rotation
        return RotationState(
            np.where(exists[:, None, None], rotation, state.rotation),
            np.where(exists[:, None], body_rate, state.body_rate),
            state.beyond,
            exists,
        )

    def joined(self, state: RotationState, slopes: tuple[_RotationSlope, ...]) -> RotationState:
        first, second, third, fourth = slopes
        mean = _RotationSlope(
            (first.rotation + 2 * second.rotation + 2 * third.rotation + fourth.rotation) / 6,
            (first.body_rate + 2 * second.body_rate + 2 * third.body_rate + fourth.body_rate) / 6,
            fourth.exists,
        )
        return self.moved(state, mean, 1.0)
