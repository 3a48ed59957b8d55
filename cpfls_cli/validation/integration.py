"""Free runs of many bodies at once under torques that are known at samples."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.validation.replay_windows import Windows
from cpfls_cli.validation.turning import Law, State

# The error of a step of the classic Runge-Kutta method that turns by x is of the order x^5 / 120: 1e-7 rad here.
_TURN_PER_STEP = 0.1
# Far beyond it the method does not follow any motion; the run is lost.
_LARGEST_TURN = 1.0
_MOST_STEPS = 20


def free_runs(law: Law, windows: Windows) -> Iterator[State]:
    """Run freely from the start of every window, ``R' = R [omega]_x`` and the law's ``omega'``.

    The classic Runge-Kutta method, in as many steps per sample as keep each turn below 0.1 rad. Between samples the
    torque is a straight line. A run is lost where the inertia is not positive definite, or where it turns faster than
    any step can follow.

    Yields
    ------
    State
        Sample after sample, from the first one behind the start.
    """
    interval = np.diff(windows.time, axis=1)
    fastest = np.max(np.linalg.norm(windows.body_rate, axis=2), initial=0.0)
    steps = int(np.clip(np.ceil(fastest * np.max(interval, initial=0.0) / _TURN_PER_STEP), 1, _MOST_STEPS))
    state = windows.start
    for sample in range(interval.shape[1]):
        torque, change = windows.torque[:, sample], np.diff(windows.torque[:, sample : sample + 2], axis=1)[:, 0]
        for step in range(steps):
            ends = torque + change * (step / steps), torque + change * ((step + 1) / steps)
            state = _step(law, state, ends, interval[:, sample, None] / steps)
        yield state


def _step(law: Law, state: State, torque: tuple[Array, Array], interval: Array) -> State:
    middle = 0.5 * (torque[0] + torque[1])
    first = _slope(law, state, torque[0])
    second = _slope(law, _moved(state, first, interval / 2), middle)
    third = _slope(law, _moved(state, second, interval / 2), middle)
    fourth = _slope(law, _moved(state, third, interval), torque[1])
    mean = _Slope(
        (first.rotation + 2 * second.rotation + 2 * third.rotation + fourth.rotation) / 6,
        (first.body_rate + 2 * second.body_rate + 2 * third.body_rate + fourth.body_rate) / 6,
        fourth.exists,
    )
    return _moved(state, mean, interval)


class _Slope(NamedTuple):
    """Derivatives of rotation and body rate, and whether all that led to them exists."""

    rotation: Array
    body_rate: Array
    exists: BoolArray


def _slope(law: Law, state: State, torque: Array) -> _Slope:
    acceleration = law(state, torque)
    turning = np.cross(state.rotation, state.body_rate[:, None])
    return _Slope(turning, acceleration.value, state.exists & acceleration.exists)


def _moved(state: State, slope: _Slope, interval: Array) -> State:
    """Move on; what would leave every bound stays, and is lost."""
    body_rate = state.body_rate + interval * slope.body_rate
    exists = slope.exists & _followed(body_rate, interval)
    rotation = state.rotation + interval[:, :, None] * slope.rotation
    return State(
        np.where(exists[:, None, None], rotation, state.rotation),
        np.where(exists[:, None], body_rate, state.body_rate),
        state.beyond,
        exists,
    )


def _followed(body_rate: Array, interval: Array) -> BoolArray:
    return np.asarray(np.linalg.norm(body_rate, axis=1) * interval[:, 0] < _LARGEST_TURN)
