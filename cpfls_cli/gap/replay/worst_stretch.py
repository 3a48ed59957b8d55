"""The stretch of a flight in which a model simulates worst, and what another model makes of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.replay.rate_equation import ReplayModel, free_runs
from cpfls_cli.gap.replay.replay import start_rate, start_samples

_ENDLESS = 1e6


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
    simulated = _runs(signals if logged is None else logged, before, starts, samples)
    exchanged = _runs(signals, after, starts, samples)
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


def _runs(signals: Signals, model: ReplayModel, starts: IntArray, samples: int) -> Array:
    """Simulate every run, its start included, shape (run, sample, 3)."""
    rate = start_rate(signals)[starts]
    # A wrong model can run away; beyond any rate that a picture shows it is all the same how far.
    with np.errstate(over="ignore", invalid="ignore"):
        steps = [step for step, _ in free_runs(model, signals, starts, rate, samples - 1)]
    run = np.nan_to_num(np.stack([rate, *steps], axis=1), nan=_ENDLESS)
    return np.asarray(np.clip(run, -_ENDLESS, _ENDLESS))
