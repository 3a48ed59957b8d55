"""Prediction by horizon: measured torques replayed through models from many points of a flight."""

# Not by `playback.player`: that counts every pitch on the near side of the vertical, where a full rotation spends less
# than half of its time, and takes one midpoint step a sample, which ends 1.1e-4 rad off where these end 4.8e-5 rad off
# (an exact flight at 100 Hz, 0.5 s).
from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.dynamics import Predictor, RotationState, free_runs, turning_law
from cpfls_cli.identification.data import TorqueSource, gathered, sample_times
from cpfls_cli.playback.player import rotation_vectors
from cpfls_cli.result import BODY, about, result
from cpfls_cli.validation.residuals import sample_period, stretch_numbers

# 40 MB of rotations, rates and torques at a time.
_SAMPLES_AT_ONCE = 200_000
CLEAR = 0.3
"""|cos(pitch)| from which on D(q) is examined: its errors come to the body axes divided by the square, here by ten."""

NOTHING_MOVES = "nothing-moves"
"""The predictor by which attitude and body rate stay what they were at the start of a window."""


def _windows(source: TorqueSource, time: Array, horizon: int, most: int) -> tuple[IntArray, int]:
    """Select windows, evenly spread over all that hold no pause and no pitch within 17 degrees of the vertical.

    Gives their first samples, ascending, and the samples behind each: the horizon is halved until a window fits; none
    where not even a single step does.
    """
    stretch = stretch_numbers(time)
    steep = np.concatenate([np.abs(np.cos(data.motion.attitude[:, 1])) < CLEAR for data in source.chunks()])
    starts = _starts(stretch, steep, horizon)
    while len(starts) == 0 and horizon > 1:
        horizon //= 2
        starts = _starts(stretch, steep, horizon)
    spread = np.unique(np.linspace(0, len(starts) - 1, min(most, len(starts))).round().astype(np.int64))
    return starts[spread], horizon


def _starts(stretch: IntArray, steep: BoolArray, horizon: int) -> IntArray:
    """List the samples from which a window stays in one stretch and clear of the vertical."""
    last = np.arange(horizon, len(stretch))
    first = last - horizon
    before = np.concatenate([[0], np.cumsum(steep)])
    clear = (stretch[last] == stretch[first]) & (before[last + 1] == before[first])
    return np.asarray(first[clear], dtype=np.int64)


def _error(text: str, over: str, unit: str) -> Any:
    """Describe errors of predictors over horizons or windows."""
    return about(text, "predictor", over, "axis", unit=unit, frame=BODY, gaps=True, brief=False)


@result
class StepErrors:
    """Root mean square errors of attitude and body rate by horizon.

    A window is lost where a predictor's inertia is not positive definite, or turns faster than any step can follow.
    """

    part: str = about("part that measured torques are replayed on")
    model: tuple[str, ...] = about("the model, the rigid body, nothing moves", "predictor")
    samples: IntArray = about("samples replayed", "horizon", brief=False)
    horizon: Array = about("the same as time", "horizon", unit="s", brief=False)
    windows: int = about("windows replayed")
    attitude: Array = _error("root mean square error; not known from where on a window is lost", "horizon", "rad")
    body_rate: Array = _error("root mean square error", "horizon", "rad/s")
    lost: IntArray = about("windows in which a predictor ran away", "predictor", "horizon", brief=False)
    window_error: Array = _error("mean squared error of the body rate over a window", "window", "(rad/s)^2")
    start: IntArray = about("first sample of each window", "window", brief=False)


def replay_steps(
    part: str,
    source: TorqueSource,
    predictors: Mapping[str, Predictor],
    horizon_samples: int,
    windows: int,
    missing: Mapping[str, Array] = MappingProxyType({}),
) -> StepErrors:
    """Replay measured body torques from many starts and compare the motion with the measured one.

    The torque is that measured, whatever attitude the prediction has come to, less the constant body torque that a
    predictor misses (N m, by name), which is not its inertia's. An array among the predictors holds the six inertia
    parameters of a rigid body. At most so many windows, evenly spread, shorter where the data have none of that length
    without a pause; NaN without any. Measure and predictor `NOTHING_MOVES`: Busetto, Cereda, Forgione and others,
    Nonlinear System Identification Nano-drone Benchmark, arXiv:2512.14450 (2025).
    """
    names, time = (*predictors, NOTHING_MOVES), sample_times(source)
    starts, horizon = _windows(source, time, horizon_samples, windows)
    squares, lost = np.zeros((2, len(names), horizon, 3)), np.zeros((len(names), horizon), dtype=np.int64)
    by_window, at_once = np.zeros((len(names), len(starts), 3)), max(_SAMPLES_AT_ONCE // (horizon + 1), 1)
    for some in (slice(first, first + at_once) for first in range(0, len(starts), at_once)):
        wanted = starts[some, None] + np.arange(horizon + 1)
        samples, index = np.unique(wanted, return_inverse=True)
        data, index = gathered(source, samples), index.reshape(wanted.shape)
        attitude, euler_rate = data.motion.attitude, data.motion.rate
        rotation = rotations.rotation_matrix(attitude)[index]
        rate = rotations.body_rate(attitude, euler_rate)[index]
        torque = rotations.body_torque(attitude, data.torque)[index]
        begin, beyond = RotationState(rotation[:, 0], rate[:, 0]), np.cos(attitude[index[:, 0], 1]) < 0
        fastest = float(np.max(np.linalg.norm(rate, axis=2), initial=0.0))
        runs: list[Iterable[RotationState]] = [
            free_runs(turning_law(own), begin, beyond, data.time[index], torque - missing.get(name, 0.0), fastest)
            for name, own in predictors.items()
        ]
        for row, run in enumerate([*runs, [begin] * horizon]):
            for step, state in enumerate(run):
                apart = state.body_rate - rate[:, step + 1]
                turned = rotation_vectors(rotation[:, step + 1], state.rotation)
                lost[row, step] += np.sum(np.isnan(apart).any(axis=1))
                squares[:, row, step] += np.sum(turned**2, axis=0), np.sum(apart**2, axis=0)
                by_window[row, some] += apart**2
    whole = (lost == 0) & (len(starts) > 0)
    off_attitude, off_rate = np.where(whole[..., None], np.sqrt(squares / max(len(starts), 1)), np.nan)
    return StepErrors(
        part=part,
        model=names,
        samples=np.arange(1, horizon + 1),
        horizon=sample_period(time) * np.arange(1, horizon + 1, dtype=float),
        windows=len(starts),
        attitude=off_attitude,
        body_rate=off_rate,
        lost=lost,
        window_error=by_window / horizon,
        start=starts,
    )
