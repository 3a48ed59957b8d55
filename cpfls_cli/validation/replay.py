"""Prediction by horizon: measured torques replayed through models from many points of a flight."""

# Not by `playback.player`: that counts every pitch on the near side of the vertical, where a full rotation spends less
# than half of its time, and takes one midpoint step a sample, which ends 1.1e-4 rad off where these end 4.8e-5 rad off
# (an exact flight at 100 Hz, 0.5 s).
from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.dynamics import Predictor, RotationState, free_runs, turning_law
from cpfls_cli.identification.data import TorqueSource, gathered, sample_times
from cpfls_cli.playback.player import rotation_vectors
from cpfls_cli.result import BODY, about
from cpfls_cli.validation.residuals import sample_period, stretch_numbers

# 40 MB of rotations, rates and torques at a time.
_SAMPLES_AT_ONCE = 200_000
CLEAR = 0.3
"""|cos(pitch)| from which on D(q) is examined: its errors come to the body axes divided by the square, here by ten."""

NOTHING_MOVES = "nothing-moves"
"""The predictor by which attitude and body rate stay what they were at the start of a window."""


@dataclass(frozen=True)
class MeasuredWindows:
    """Measured motion and torque in windows of equal length, shape (window, sample, ...).

    Time in s, rotation from body to world, body rate in rad/s and torque in N m in the body frame. `beyond`: whether
    the pitch of the flight is beyond +-90 degrees; in no window it crosses them.
    """

    time: Array
    rotation: Array
    body_rate: Array
    torque: Array
    beyond: BoolArray

    @property
    def start(self) -> RotationState:
        """Measured state at the start of the windows."""
        return RotationState(self.rotation[:, 0], self.body_rate[:, 0])


@dataclass(frozen=True)
class WindowPlan:
    """First samples of windows, ascending, and the samples behind each.

    Those are fewer than asked for where no window of that length fits; `period` is the usual time between samples, s.
    """

    start: IntArray
    horizon: int
    period: float


def plan_windows(source: TorqueSource, horizon: int, most: int) -> WindowPlan:
    """Select windows, evenly spread over all that hold no pause and no pitch within 17 degrees of the vertical.

    The horizon is halved until a window fits; none where not even a single step does.
    """
    time = sample_times(source)
    stretch = stretch_numbers(time)
    steep = np.concatenate([np.abs(np.cos(data.motion.attitude[:, 1])) < CLEAR for data in source.chunks()])
    starts = _starts(stretch, steep, horizon)
    while len(starts) == 0 and horizon > 1:
        horizon //= 2
        starts = _starts(stretch, steep, horizon)
    spread = np.unique(np.linspace(0, len(starts) - 1, min(most, len(starts))).round().astype(np.int64))
    return WindowPlan(starts[spread], horizon, sample_period(time))


def read_windows(source: TorqueSource, plan: WindowPlan) -> Iterator[MeasuredWindows]:
    """Read the measurements in the windows, some windows at a time."""
    at_once = max(_SAMPLES_AT_ONCE // (plan.horizon + 1), 1)
    for first in range(0, len(plan.start), at_once):
        wanted = plan.start[first : first + at_once, None] + np.arange(plan.horizon + 1)
        samples, index = np.unique(wanted, return_inverse=True)
        data, index = gathered(source, samples), index.reshape(wanted.shape)
        attitude, rate = data.motion.attitude, data.motion.rate
        yield MeasuredWindows(
            time=data.time[index],
            rotation=rotations.rotation_matrix(attitude)[index],
            body_rate=rotations.body_rate(attitude, rate)[index],
            torque=rotations.body_torque(attitude, data.torque)[index],
            beyond=np.cos(attitude[index[:, 0], 1]) < 0,
        )


def _starts(stretch: IntArray, steep: BoolArray, horizon: int) -> IntArray:
    """List the samples from which a window stays in one stretch and clear of the vertical."""
    last = np.arange(horizon, len(stretch))
    first = last - horizon
    before = np.concatenate([[0], np.cumsum(steep)])
    clear = (stretch[last] == stretch[first]) & (before[last + 1] == before[first])
    return np.asarray(first[clear], dtype=np.int64)


@dataclass(frozen=True, eq=False)
class StepErrors:
    """Root mean square errors of attitude and body rate by horizon.

    A window is lost where a predictor's inertia is not positive definite, or turns faster than any step can follow.
    """

    part: str = about("part that measured torques are replayed on")
    model: tuple[str, ...] = about("the model, the rigid body, nothing moves", "predictor")
    samples: IntArray = about("samples replayed", "horizon", brief=False)
    horizon: Array = about("the same as time", "horizon", unit="s", brief=False)
    windows: int = about("windows replayed")
    attitude: Array = about(
        "root mean square error; not known from where on a window is lost",
        "predictor",
        "horizon",
        "axis",
        unit="rad",
        frame=BODY,
        gaps=True,
        brief=False,
    )
    body_rate: Array = about(
        "root mean square error", "predictor", "horizon", "axis", unit="rad/s", frame=BODY, gaps=True, brief=False
    )
    lost: IntArray = about("windows in which a predictor ran away", "predictor", "horizon", brief=False)
    window_error: Array = about(
        "mean squared error of the body rate over a window",
        "predictor",
        "window",
        "axis",
        unit="(rad/s)^2",
        frame=BODY,
        gaps=True,
        brief=False,
    )
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
    plan, names = plan_windows(source, horizon_samples, windows), (*predictors, NOTHING_MOVES)
    sums = [_SquaredErrors(plan.horizon) for _ in names]
    for measured in read_windows(source, plan):
        runs = [
            _run(predictor, replace(measured, torque=measured.torque - missing.get(name, 0.0)))
            for name, predictor in predictors.items()
        ]
        for errors, run in zip(sums, [*runs, _still(measured)], strict=True):
            errors.add(measured, run)
    return StepErrors(
        part=part,
        model=names,
        samples=np.arange(1, plan.horizon + 1),
        horizon=plan.period * np.arange(1, plan.horizon + 1, dtype=float),
        windows=len(plan.start),
        attitude=np.array([errors.root_mean_square(errors.attitude) for errors in sums]),
        body_rate=np.array([errors.root_mean_square(errors.body_rate) for errors in sums]),
        lost=np.array([errors.lost for errors in sums]),
        window_error=np.array([np.concatenate([np.zeros((0, 3)), *errors.window_error]) for errors in sums]),
        start=plan.start,
    )


class _SquaredErrors:
    """Squared errors by horizon and axis, and by window."""

    def __init__(self, horizon: int) -> None:
        self.attitude, self.body_rate = np.zeros((horizon, 3)), np.zeros((horizon, 3))
        self.lost = np.zeros(horizon, dtype=np.int64)
        self.windows = 0
        self.window_error: list[Array] = []

    def add(self, measured: MeasuredWindows, run: Iterator[RotationState]) -> None:
        by_window = np.zeros((len(measured.time), 3))
        for step, state in enumerate(run):
            turned = rotation_vectors(measured.rotation[:, step + 1], state.rotation)
            rate = state.body_rate - measured.body_rate[:, step + 1]
            self.lost[step] += np.sum(np.isnan(rate).any(axis=1))
            self.attitude[step] += np.sum(turned**2, axis=0)
            self.body_rate[step] += np.sum(rate**2, axis=0)
            by_window += rate**2
        self.windows += len(by_window)
        self.window_error.append(by_window / len(self.lost))

    def root_mean_square(self, squares: Array) -> Array:
        whole = (self.lost == 0) & (self.windows > 0)
        return np.where(whole[:, None], np.sqrt(squares / max(self.windows, 1)), np.nan)


def _still(measured: MeasuredWindows) -> Iterator[RotationState]:
    return iter([measured.start] * (measured.time.shape[1] - 1))


def _run(predictor: Predictor, windows: MeasuredWindows) -> Iterator[RotationState]:
    fastest = float(np.max(np.linalg.norm(windows.body_rate, axis=2), initial=0.0))
    return free_runs(turning_law(predictor), windows.start, windows.beyond, windows.time, windows.torque, fastest)
