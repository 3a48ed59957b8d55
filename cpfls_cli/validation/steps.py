"""Prediction by horizon: measured torques replayed through models from many points of a flight."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.dynamics.equations_of_motion import Predictor, RotationState, acceleration_law
from cpfls_cli.dynamics.integration import free_runs
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.validation.replay_windows import Windows, plan_windows, read_windows

NOTHING_MOVES = "nothing-moves"
"""The predictor by which attitude and body rate stay what they were at the start of a window."""


@dataclass(frozen=True)
class StepErrors:
    """Root mean square errors of attitude and body rate by horizon.

    Attributes
    ----------
    part : str
        Part of the data.
    model : tuple of str
        Predictors; the last one is `NOTHING_MOVES`.
    samples : array of int, shape (horizon,)
        From 1.
    horizon : array, shape (horizon,), s
    windows : int
        Windows replayed.
    attitude : array, shape (predictor, horizon, 3), rad
        Of the rotation vector from the measured to the predicted attitude, body axes. NaN from where on a predictor
        has lost a window: then it has no such error.
    body_rate : array, shape (predictor, horizon, 3), rad/s, body axes
    lost : array of int, shape (predictor, horizon)
        Windows in which a predictor's inertia was not positive definite, or which it turned faster than any step can
        follow.
    window_error : array, shape (predictor, window, 3), (rad/s)^2
        Mean squared error of the body rate over a window; NaN where lost. To compare predictors window by window.
    start : array of int, shape (window,)
        First sample of each window, ascending.
    """

    part: str
    model: tuple[str, ...]
    samples: IntArray
    horizon: Array
    windows: int
    attitude: Array
    body_rate: Array
    lost: IntArray
    window_error: Array
    start: IntArray


def replay_steps(
    part: str,
    source: TorqueSource,
    predictors: Mapping[str, Predictor],
    horizon_samples: int,
    windows: int,
    missing: Mapping[str, Array] = MappingProxyType({}),
) -> StepErrors:
    """Replay measured torques from many starts and compare with what was measured.

    The body torque is that measured, whatever attitude the prediction has come to.

    Parameters
    ----------
    part : str
        Name of the part of the data.
    source : TorqueSource
    predictors : mapping of str to InertiaModel or array, shape (6,)
        By name; an array holds the inertia parameters of a rigid body.
    horizon_samples : int
        Length of the windows; shorter where the data have no window of that length without a pause.
    windows : int
        Windows at most, evenly spread.
    missing : mapping of str to array, shape (3,), N m, body frame, optional
        Constant torque that a predictor misses, which is not its inertia's; taken off what was measured.

    Returns
    -------
    StepErrors
        NaN throughout where the data have no window at all.

    References
    ----------
    Measure and predictor `NOTHING_MOVES`: Busetto, Cereda, Forgione and others, Nonlinear System Identification
    Nano-drone Benchmark, arXiv:2512.14450 (2025).
    """
    plan, names = plan_windows(source, horizon_samples, windows), (*predictors, NOTHING_MOVES)
    sums = [_Sums(plan.horizon) for _ in names]
    for measured in read_windows(source, plan):
        runs = [
            _run(predictor, replace(measured, torque=measured.torque - missing.get(name, 0.0)))
            for name, predictor in predictors.items()
        ]
        for own, run in zip(sums, [*runs, _still(measured)], strict=True):
            own.add(measured, run)
    return StepErrors(
        part=part,
        model=names,
        samples=np.arange(1, plan.horizon + 1),
        horizon=plan.period * np.arange(1, plan.horizon + 1, dtype=float),
        windows=len(plan.start),
        attitude=np.array([own.root_mean_square(own.attitude) for own in sums]),
        body_rate=np.array([own.root_mean_square(own.body_rate) for own in sums]),
        lost=np.array([own.lost for own in sums]),
        window_error=np.array([np.concatenate([np.zeros((0, 3)), *own.window_error]) for own in sums]),
        start=plan.start,
    )


class _Sums:
    """Squared errors by horizon and axis, and by window."""

    def __init__(self, horizon: int) -> None:
        self.attitude, self.body_rate = np.zeros((horizon, 3)), np.zeros((horizon, 3))
        self.lost = np.zeros(horizon, dtype=np.int64)
        self.windows = 0
        self.window_error: list[Array] = []

    def add(self, measured: Windows, run: Iterator[RotationState]) -> None:
        by_window = np.zeros((len(measured.time), 3))
        for step, state in enumerate(run):
            turned, rate = _errors(measured, step + 1, state)
            self.lost[step] += np.sum(~state.exists)
            self.attitude[step] += np.sum(turned**2, axis=0)
            self.body_rate[step] += np.sum(rate**2, axis=0)
            by_window += np.where(state.exists[:, None], rate**2, np.nan)
        self.windows += len(by_window)
        self.window_error.append(by_window / len(self.lost))

    def root_mean_square(self, squares: Array) -> Array:
        whole = (self.lost == 0) & (self.windows > 0)
        return np.where(whole[:, None], np.sqrt(squares / max(self.windows, 1)), np.nan)


def _errors(measured: Windows, sample: int, state: RotationState) -> tuple[Array, Array]:
    away = measured.rotation[:, sample].swapaxes(1, 2) @ state.rotation
    return Rotation.from_matrix(away).as_rotvec(), state.body_rate - measured.body_rate[:, sample]


def _still(measured: Windows) -> Iterator[RotationState]:
    return iter([measured.start] * (measured.time.shape[1] - 1))


def _run(predictor: Predictor, windows: Windows) -> Iterator[RotationState]:
    fastest = float(np.max(np.linalg.norm(windows.body_rate, axis=2), initial=0.0))
    return free_runs(acceleration_law(predictor), windows.start, windows.time, windows.torque, fastest)
