"""Attitude and body rate from many starts at once, driven by a torque that is known along the flight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import ComputationError
from cpfls_cli.gap.balance.inertial import InertiaModel, rotation_balance
from cpfls_cli.regressor.regressor import InertiaValues


@dataclass(frozen=True)
class ReplayModel:
    """What turns actuation into rotation.

    Attributes
    ----------
    torque : array, shape (time, 3), N m, body frame
        Of the rotors and of the effects of the model, evaluated along the measured motion.
    inertia : array, shape (3, 3), kg m^2, or InertiaModel
        A tensor, or a model in Euler coordinates.
    """

    torque: Array
    inertia: Array | InertiaModel


class State(NamedTuple):
    """Rotation of a set of free runs.

    Attributes
    ----------
    momentum : array, shape (run, 3), N m s, body frame
    rotation : array, shape (run, 3, 3), or None
        Body to world; None where the attitude is not known.
    """

    momentum: Array
    rotation: Array | None


def free_runs(
    model: ReplayModel, signals: Signals, starts: IntArray, rate: Array, horizon: int
) -> Iterator[tuple[Array, Array | None]]:
    """Integrate from each start, sample by sample.

    ``d/dt momentum = M - direct(attitude, rate)`` and ``dR/dt = R [rate]_x`` by the classic Runge-Kutta method; for a
    rigid body the momentum is ``I omega`` and the direct term ``omega x I omega``. Between samples the torque is a
    straight line.

    Parameters
    ----------
    model : ReplayModel
    signals : Signals
        Gives the attitude at the starts.
    starts : array of int, shape (run,)
    rate : array, shape (run, 3), rad/s
        Body rate at the starts.
    horizon : int
        Samples.

    Yields
    ------
    rate : array, shape (run, 3), rad/s, body frame
    rotation : array, shape (run, 3, 3), or None

    Raises
    ------
    ComputationError
        If the model needs an attitude that the flight lacks, or has no inverse somewhere.
    """
    if signals.attitude is None and not isinstance(model.inertia, np.ndarray):
        raise ComputationError("a model in Euler coordinates needs the attitude, which the flight lacks")
    body = _Body(model.inertia, signals)
    rotation = None if signals.attitude is None else signals.rotation[starts]
    state = State(body.momentum(rotation, rate), rotation)
    for step in range(horizon):
        at = starts + step
        state = _runge_kutta(body, state, model.torque[at], model.torque[at + 1], signals.period)
        yield body.rate(state), state.rotation


class _Body:
    """Momentum, rate and their equation for a tensor or a model in Euler coordinates."""

    def __init__(self, inertia: Array | InertiaModel, signals: Signals) -> None:
        self.inertia, self.signals = inertia, signals

    def momentum(self, rotation: Array | None, rate: Array) -> Array:
        return rotations.multiply(self._matrices(rotation, len(rate))[0], rate)

    def rate(self, state: State) -> Array:
        return _solved(self._matrices(state.rotation, len(state.momentum))[0], state.momentum)

    def slope(self, state: State, torque: Array) -> State:
        matrices, known = self._matrices(state.rotation, len(torque))
        rate = _solved(matrices, state.momentum)
        if known is None:
            direct = np.cross(rate, state.momentum)
        else:
            assert state.rotation is not None
            here = Signals(
                time=self.signals.time[: len(rate)],
                body_rate=rate,
                vehicle=self.signals.vehicle,
                attitude=euler_angles(state.rotation),
            )
            direct = rotation_balance(here, known).direct
        return State(torque - direct, None if state.rotation is None else _turning(state.rotation, rate))

    def _matrices(self, rotation: Array | None, runs: int) -> tuple[Array, _Known | None]:
        """Give the matrix from rate to momentum, ``W^-T J W^-1`` in Euler coordinates."""
        if isinstance(self.inertia, np.ndarray):
            return np.broadcast_to(self.inertia, (runs, 3, 3)), None
        assert rotation is not None
        attitude = euler_angles(rotation)
        values = self.inertia.inertia(attitude)
        inverse = np.linalg.inv(rotations.euler_rate_matrix(attitude))
        return inverse.swapaxes(1, 2) @ values.value @ inverse, _Known(values)


class _Known(NamedTuple):
    """A model whose values are at hand, so that a step evaluates it once."""

    values: InertiaValues

    def inertia(self, attitude: Array) -> InertiaValues:  # noqa: ARG002
        return self.values


def euler_angles(rotation: Array) -> Array:
    """Read roll, pitch and yaw off rotation matrices.

    Parameters
    ----------
    rotation : array, shape (run, 3, 3)
        Body to world, ``Rz(yaw) Ry(pitch) Rx(roll)``.

    Returns
    -------
    array, shape (run, 3), rad
    """
    roll = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    pitch = np.arctan2(-rotation[:, 2, 0], np.hypot(rotation[:, 2, 1], rotation[:, 2, 2]))
    return np.stack([roll, pitch, np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])], axis=1)


def _runge_kutta(body: _Body, state: State, torque: Array, torque_next: Array, period: float) -> State:
    middle = 0.5 * (torque + torque_next)
    first = body.slope(state, torque)
    second = body.slope(_moved(state, first, period / 2), middle)
    third = body.slope(_moved(state, second, period / 2), middle)
    fourth = body.slope(_moved(state, third, period), torque_next)
    for slope, share in ((first, 1 / 6), (second, 1 / 3), (third, 1 / 3), (fourth, 1 / 6)):
        state = _moved(state, slope, share * period)
    return state


def _moved(state: State, slope: State, period: float) -> State:
    if state.rotation is None or slope.rotation is None:
        return State(state.momentum + period * slope.momentum, None)
    return State(state.momentum + period * slope.momentum, state.rotation + period * slope.rotation)


def _turning(rotation: Array, rate: Array) -> Array:
    """Multiply ``R [rate]_x``: row by row a cross product with the rate."""
    return np.cross(rotation, rate[:, None])


def _solved(matrices: Array, momentum: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(matrices, momentum[..., None])[..., 0])
    except np.linalg.LinAlgError as error:
        raise ComputationError("the inertia matrix of the model has no inverse at an attitude of the flight") from error
