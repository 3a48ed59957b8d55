"""How far models are off after a number of samples, over flights that they did not see."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.extended import ExtendedModel
from cpfls_cli.gap.replay.replay import ReplayError, held, replay, start_samples

_EVERY = 5


@dataclass(frozen=True)
class Replayed:
    """Root mean square errors by horizon.

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
    """Replay the actuation of flights through a model from every fifth sample.

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
    return _joined([_run(model)(signals, longest) for signals in flights])


def _run(model: ExtendedModel | None) -> Callable[[Signals, int], ReplayError]:
    def run(signals: Signals, horizon: int) -> ReplayError:
        repaired = signals if model is None else model.repaired(signals)
        starts = start_samples(signals, _EVERY, horizon)
        if model is None:
            return held(signals, starts, horizon)
        return replay(repaired, starts, horizon, model.replay_model(repaired))

    return run


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
