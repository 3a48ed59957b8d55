"""Windows of a flight that measured torques are replayed over."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.dynamics.equations_of_motion import RotationState
from cpfls_cli.identification.data import TorqueSource, gathered, sample_times
from cpfls_cli.validation.stretches import sample_period, stretch_numbers

# 40 MB of rotations, rates and torques at a time.
_SAMPLES_AT_ONCE = 200_000
CLEAR = 0.3
"""|cos(pitch)| from which on D(q) is looked at: its errors come to the body axes divided by the square, here by ten."""


@dataclass(frozen=True)
class Windows:
    """What was measured in windows of equal length.

    Attributes
    ----------
    time : array, shape (window, sample), s
    rotation : array, shape (window, sample, 3, 3)
        Body to world.
    body_rate : array, shape (window, sample, 3), rad/s, body frame
    torque : array, shape (window, sample, 3), N m, body frame
    beyond : array of bool, shape (window,)
        Whether the pitch of the flight is beyond +-90 degrees; in no window it crosses them.
    """

    time: Array
    rotation: Array
    body_rate: Array
    torque: Array
    beyond: BoolArray

    @property
    def start(self) -> RotationState:
        """What was measured at the start of the windows."""
        return RotationState(
            self.rotation[:, 0], self.body_rate[:, 0], self.beyond, np.ones(len(self.time), dtype=bool)
        )


@dataclass(frozen=True)
class Plan:
    """Where windows start, and how long they are.

    Attributes
    ----------
    start : array of int, shape (window,)
        Sample, ascending.
    horizon : int
        Samples behind the start; fewer than asked for where no window of that length fits.
    period : float, s
        Usual time between samples.
    """

    start: IntArray
    horizon: int
    period: float


def plan_windows(source: TorqueSource, horizon: int, most: int) -> Plan:
    """Choose windows, evenly spread over all that hold no pause and no pitch within 17 degrees of the vertical.

    Parameters
    ----------
    source : TorqueSource
    horizon : int
        Samples; halved until a window fits.
    most : int
        Windows.

    Returns
    -------
    Plan
        Without windows where not even one of a single step fits.
    """
    time = sample_times(source)
    stretch = stretch_numbers(time)
    steep = np.concatenate([np.abs(np.cos(data.motion.attitude[:, 1])) < CLEAR for data in source.chunks()])
    starts = _starts(stretch, steep, horizon)
    while len(starts) == 0 and horizon > 1:
        horizon //= 2
        starts = _starts(stretch, steep, horizon)
    spread = np.unique(np.linspace(0, len(starts) - 1, min(most, len(starts))).round().astype(np.int64))
    return Plan(starts[spread], horizon, sample_period(time))


def read_windows(source: TorqueSource, plan: Plan) -> Iterator[Windows]:
    """Gather what was measured in the windows, some windows at a time."""
    at_once = max(_SAMPLES_AT_ONCE // (plan.horizon + 1), 1)
    for first in range(0, len(plan.start), at_once):
        wanted = plan.start[first : first + at_once, None] + np.arange(plan.horizon + 1)
        samples, places = np.unique(wanted, return_inverse=True)
        data, places = gathered(source, samples), places.reshape(wanted.shape)
        attitude, rate = data.motion.attitude, data.motion.rate
        yield Windows(
            time=data.time[places],
            rotation=rotations.rotation_matrix(attitude)[places],
            body_rate=rotations.body_rate(attitude, rate)[places],
            torque=rotations.body_torque(attitude, data.torque)[places],
            beyond=np.cos(attitude[places[:, 0], 1]) < 0,
        )


def _starts(stretch: IntArray, steep: BoolArray, horizon: int) -> IntArray:
    """List the samples from which a window stays in one stretch and clear of the vertical."""
    last = np.arange(horizon, len(stretch))
    first = last - horizon
    before = np.concatenate([[0], np.cumsum(steep)])
    clear = (stretch[last] == stretch[first]) & (before[last + 1] == before[first])
    return np.asarray(first[clear], dtype=np.int64)
