"""Simulation from many points of a flight, driven by its own actuation: how the error grows with the horizon."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.gap.replay.rate_equation import ReplayModel, free_runs
from cpfls_cli.vehicle.rigid_body import inertia_tensor

_ROTATION = 0.5
_ENDLESS = 1e9
_SMOOTHED_SAMPLES = 7
_SMOOTHED_DEGREE = 2


@dataclass(frozen=True)
class ReplayError:
    """Error of a simulation after a horizon.

    Attributes
    ----------
    horizon_s : array, shape (horizon,), s
    rate : array, shape (horizon, 3), rad/s, body axes
        Root mean square over all starts, predicted minus measured.
    attitude : array, shape (horizon, 3), rad, body axes, or None
        Root mean square of the rotation from the measured to the predicted attitude; None without attitude.
    starts : int
    """

    horizon_s: Array
    rate: Array
    attitude: Array | None
    starts: int


def start_samples(signals: Signals, every: int, horizon: int) -> IntArray:
    """List every n-th sample from which a horizon fits into the flight.

    Parameters
    ----------
    signals : Signals
    every : int
    horizon : int
        Samples.

    Raises
    ------
    InputError
        If the flight is shorter than the horizon.
    """
    starts = np.arange(0, len(signals) - horizon, every)
    if not len(starts) or len(signals) < _SMOOTHED_SAMPLES:
        raise InputError(f"a flight of {len(signals)} samples is too short to simulate {horizon} of them")
    return starts


def replay(signals: Signals, starts: IntArray, horizon: int, model: ReplayModel) -> ReplayError:
    """Simulate from every start and compare with what was measured.

    The torque is that along the measured motion, so that the error of one start does not change what drives it. Each
    run starts from `start_rate`.

    Parameters
    ----------
    signals : Signals
    starts : array of int
        As from `start_samples`.
    horizon : int
        Samples.
    model : ReplayModel
    """
    return _compared(signals, starts, free_runs(model, signals, starts, start_rate(signals)[starts], horizon))


def held(signals: Signals, starts: IntArray, horizon: int) -> ReplayError:
    """Predict that the body rate stays what it was: what a model has to beat.

    Parameters
    ----------
    signals : Signals
    starts : array of int
    horizon : int
        Samples.
    """
    rate = start_rate(signals)[starts]
    turned = [None] * horizon if signals.attitude is None else _held_rotation(signals, starts, rate, horizon)
    return _compared(signals, starts, ((rate, rotation) for rotation in turned))


def rigid_body(signals: Signals) -> ReplayModel:
    """Give the rigid body of the vehicle under the torque of its rotors alone.

    Raises
    ------
    InputError
        If the flight has no torque.
    """
    if signals.torque is None:
        raise InputError("a flight without rotor speeds or torque cannot be simulated")
    return ReplayModel(signals.torque, inertia_tensor(signals.vehicle))


def start_rate(signals: Signals) -> Array:
    """Smooth the measured body rate over seven samples, with a parabola.

    The noise of a single sample would be an error of the start that stays over the whole horizon and hides the model's.
    The average is symmetric, so it does not lag; it looks three samples ahead, equally for all models, and says nothing
    of the torque.

    Returns
    -------
    array, shape (time, 3), rad/s

    References
    ----------
    Savitzky and Golay 1964.
    """
    return np.asarray(savgol_filter(signals.body_rate, _SMOOTHED_SAMPLES, _SMOOTHED_DEGREE, axis=0))


def _held_rotation(signals: Signals, starts: IntArray, rate: Array, horizon: int) -> list[Array]:
    turn = [Rotation.from_rotvec(step * signals.period * rate).as_matrix() for step in range(1, horizon + 1)]
    return [signals.rotation[starts] @ turned for turned in turn]


def _compared(signals: Signals, starts: IntArray, runs: Iterable[tuple[Array, Array | None]]) -> ReplayError:
    rates: list[Array] = []
    attitudes: list[Array] = []
    # A wrong model can run away within a horizon; what overflows then is large, and that is all there is to say.
    with np.errstate(over="ignore", invalid="ignore"):
        for step, (rate, rotation) in enumerate(runs, start=1):
            at = starts + step
            rates.append(_rms(rate - signals.body_rate[at]))
            if rotation is not None:
                away = signals.rotation[at].swapaxes(1, 2) @ rotation
                attitudes.append(_rms(_turned(away)))
    horizon_s: Array = signals.period * np.arange(1, len(rates) + 1, dtype=float)
    return ReplayError(horizon_s, np.array(rates), np.array(attitudes) if attitudes else None, len(starts))


def _turned(away: Array) -> Array:
    """Give the turn of each rotation; half a turn, the most there is, where a simulation ran away."""
    usable = np.isfinite(away).all(axis=(1, 2)) & (np.abs(np.linalg.det(np.nan_to_num(away)) - 1) < _ROTATION)
    turn = np.full((len(away), 3), np.pi / np.sqrt(3))
    if usable.any():
        turn[usable] = Rotation.from_matrix(away[usable]).as_rotvec()
    return turn


def _rms(error: Array) -> Array:
    return np.asarray(np.nan_to_num(np.sqrt(np.mean(error**2, axis=0)), nan=_ENDLESS, posinf=_ENDLESS))
