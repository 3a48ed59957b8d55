"""Flights simulated from many of their points: how the error grows with the horizon, and the worst stretch."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.dynamics.integration import ReplayModel, momentum_runs
from cpfls_cli.dynamics.rigid_body import inertia_tensor
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.gap.extended import ExtendedModel

_ROTATION = 0.5
_ENDLESS_ERROR, _ENDLESS_RATE = 1e9, 1e6
_SMOOTHED_SAMPLES = 7
_SMOOTHED_DEGREE = 2
_EVERY = 5


@dataclass(frozen=True)
class ReplayError:
    """Error of the simulation of one flight by horizon.

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
    """Simulate free runs from every start and compare them with the measurements.

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
    return _compared(signals, starts, _free_runs(signals, starts, model, horizon))


def held(signals: Signals, starts: IntArray, horizon: int) -> ReplayError:
    """Predict that the body rate stays constant, as the reference that a model has to beat.

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
    """Make a replay model of the rigid body of the vehicle under the torque of its rotors alone.

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


def _free_runs(
    signals: Signals, starts: IntArray, model: ReplayModel, horizon: int
) -> Iterator[tuple[Array, Array | None]]:
    rotation = None if signals.attitude is None else signals.rotation[starts]
    return momentum_runs(model, starts, start_rate(signals)[starts], rotation, signals.period, horizon)


def _held_rotation(signals: Signals, starts: IntArray, rate: Array, horizon: int) -> list[Array]:
    turn = [Rotation.from_rotvec(step * signals.period * rate).as_matrix() for step in range(1, horizon + 1)]
    return [signals.rotation[starts] @ turned for turned in turn]


def _compared(signals: Signals, starts: IntArray, runs: Iterable[tuple[Array, Array | None]]) -> ReplayError:
    rates: list[Array] = []
    attitudes: list[Array] = []
    # A wrong model can diverge within a horizon; that its error is large is then all that counts.
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
    """Compute the rotation vectors; half a turn, the most there is, where a simulation diverged."""
    usable = np.isfinite(away).all(axis=(1, 2)) & (np.abs(np.linalg.det(np.nan_to_num(away)) - 1) < _ROTATION)
    turn = np.full((len(away), 3), np.pi / np.sqrt(3))
    if usable.any():
        turn[usable] = Rotation.from_matrix(away[usable]).as_rotvec()
    return turn


def _rms(error: Array) -> Array:
    return np.asarray(np.nan_to_num(np.sqrt(np.mean(error**2, axis=0)), nan=_ENDLESS_ERROR, posinf=_ENDLESS_ERROR))


@dataclass(frozen=True)
class Replayed:
    """Root mean square errors over several flights by horizon.

    Attributes
    ----------
    horizon_s : array, shape (horizon,), s
    rate : array, shape (horizon, 3), rad/s
    attitude : array, shape (horizon, 3), rad
        NaN without attitude.
    """

    horizon_s: Array
    rate: Array
    attitude: Array


def replayed(flights: Sequence[Signals], model: ExtendedModel | None, horizon: int) -> Replayed:
    """Replay flights through a model from every fifth sample and average the errors by horizon.

    Parameters
    ----------
    flights : sequence of Signals
        Of one rate, with torque.
    model : ExtendedModel or None
        None for rates that stay what they are.
    horizon : int
        Samples, at most.
    """
    longest = min(horizon, *(len(signals) - 1 - _EVERY for signals in flights))
    return _joined([_errors(signals, model, longest) for signals in flights])


def _errors(signals: Signals, model: ExtendedModel | None, horizon: int) -> ReplayError:
    starts = start_samples(signals, _EVERY, horizon)
    if model is None:
        return held(signals, starts, horizon)
    repaired = model.repaired(signals)
    return replay(repaired, starts, horizon, model.replay_model(repaired))


def _joined(errors: Sequence[ReplayError]) -> Replayed:
    weight = np.array([error.starts for error in errors], dtype=float)
    rate = _mean([error.rate for error in errors], weight)
    known = [error.attitude is not None for error in errors]
    attitude = np.full_like(rate, np.nan)
    if any(known):
        attitude = _mean([e.attitude for e in errors if e.attitude is not None], weight[known])
    return Replayed(errors[0].horizon_s, rate, attitude)


def _mean(values: Sequence[Array], weight: Array) -> Array:
    square = np.tensordot(weight / weight.sum(), np.array(values) ** 2, axes=1)
    return np.asarray(np.sqrt(square))


@dataclass(frozen=True)
class WorstStretch:
    """Measured and simulated body rates over a stretch of a flight.

    Attributes
    ----------
    time : array, shape (time,), s
        On the clock of the flight.
    measured, before, after : array, shape (time, 3), rad/s, body frame
        Simulations start anew from the measured rate at `restarts`.
    restarts : array, shape (run,), s
    axis : int
        Body axis on which the first model is worst.
    """

    time: Array
    measured: Array
    before: Array
    after: Array
    restarts: Array
    axis: int


def worst_stretch(
    signals: Signals,
    before: ReplayModel,
    after: ReplayModel,
    logged: Signals | None = None,
    *,
    length_s: float = 2.0,
    run_s: float = 1.0,
) -> WorstStretch:
    """Find the stretch in which free runs of the first model are farthest from the flight.

    The flight is simulated in runs of one second, one after another, by both models; the stretch is made of whole runs.

    Parameters
    ----------
    signals : Signals
        What the models are held against.
    before, after : ReplayModel
    logged : Signals or None
        What the first model starts from, where faults of the sensors were taken out of `signals`.
    length_s : float
        Of the stretch, s.
    run_s : float
        Of each free run, s.

    Raises
    ------
    InputError
        If the flight is shorter than one run.
    """
    samples = max(1, round(run_s / signals.period))
    starts = start_samples(signals, samples, samples - 1)
    measured = signals.body_rate[starts[:, None] + np.arange(samples)]
    simulated = _simulated(signals if logged is None else logged, before, starts, samples)
    exchanged = _simulated(signals, after, starts, samples)
    square = ((simulated - measured) ** 2).sum(axis=1)
    joined = min(len(starts), max(1, round(length_s / run_s)))
    first = int(np.convolve(square.sum(axis=1), np.ones(joined), mode="valid").argmax())
    runs = slice(first, first + joined)
    return WorstStretch(
        time=signals.time[starts[runs, None] + np.arange(samples)].ravel(),
        measured=measured[runs].reshape(-1, 3),
        before=simulated[runs].reshape(-1, 3),
        after=exchanged[runs].reshape(-1, 3),
        restarts=signals.time[starts[runs]],
        axis=int(square[runs].sum(axis=0).argmax()),
    )


def _simulated(signals: Signals, model: ReplayModel, starts: IntArray, samples: int) -> Array:
    """Simulate every run, its start included, shape (run, sample, 3)."""
    # A wrong model can diverge; beyond any rate that a figure shows its size does not matter.
    with np.errstate(over="ignore", invalid="ignore"):
        steps = [rate for rate, _ in _free_runs(signals, starts, model, samples - 1)]
    run = np.nan_to_num(np.stack([start_rate(signals)[starts], *steps], axis=1), nan=_ENDLESS_RATE)
    return np.asarray(np.clip(run, -_ENDLESS_RATE, _ENDLESS_RATE))
