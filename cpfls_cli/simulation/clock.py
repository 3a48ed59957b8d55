"""Steps of the integration, and values in their middle."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError

_ROUNDING = 1e-6


@dataclass(frozen=True)
class Clock:
    """Steps of the integration between the samples of the plan.

    Attributes
    ----------
    parts : int
        Steps from sample to sample.
    steps : int
    step : float, s
    instants : array, shape (1 + step,), s
        The start, then the middle of each step.
    """

    parts: int
    steps: int
    step: float
    instants: Array


def clock_of(time: Array, rate: float) -> Clock:
    """Divide the samples of a plan into steps.

    Parameters
    ----------
    time : array, shape (time,), s
    rate : float, Hz
        Of the steps, at least.

    Raises
    ------
    ComputationError
        If the plan is not sampled uniformly.
    """
    if len(time) < 2 or np.ptp(np.diff(time)) > _ROUNDING * (time[1] - time[0]):
        raise ComputationError("a flight in closed loop needs a trajectory of two or more samples at one rate")
    period = float(time[-1] - time[0]) / (len(time) - 1)
    parts = ceil(period * rate - _ROUNDING)
    steps, step = (len(time) - 1) * parts, period / parts
    return Clock(parts, steps, step, time[0] + step * np.concatenate([[0.0], np.arange(steps) + 0.5]))


def between(middles: Array) -> Array:
    """Bring values from the middles of steps to their ends, on straight lines.

    Parameters
    ----------
    middles : array, shape (step, ...)

    Returns
    -------
    array, shape (1 + step, ...)
    """
    if len(middles) < 2:
        return np.concatenate([middles, middles])
    ends = 2 * middles[0] - middles[1], 2 * middles[-1] - middles[-2]
    longer = np.concatenate([ends[0][None], middles, ends[1][None]])
    return np.asarray(0.5 * (longer[1:] + longer[:-1]))
