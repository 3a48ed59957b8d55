"""Samples in the order of time: stretches without a pause, places with those that are missing, the leading ones."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.identification.data import TorqueData, TorqueSource, gathered

# Flights of several sample rates may follow each other, and samples may be missing: as many steps around each tell
# what is usual there.
_STEPS_AROUND = 25


def sample_period(time: Array) -> float:
    """Give the usual time from one sample to the next.

    Parameters
    ----------
    time : array, shape (samples,), s

    Returns
    -------
    float, s
        The median; NaN for a single sample.
    """
    return float(np.median(np.diff(time))) if len(time) > 1 else float("nan")


def stretch_numbers(time: Array) -> IntArray:
    """Give every sample the number of its stretch, in which one follows the other without a pause.

    Parameters
    ----------
    time : array, shape (samples,), s
        Ascending; may jitter by less than half a step.

    Returns
    -------
    array of int, shape (samples,)
        From 0; a new number behind every step of more than one and a half of those usual around it.
    """
    number = np.zeros(len(time), dtype=np.int64)
    number[1:] = np.cumsum(_steps(time) > 1)
    return number


def sample_numbers(time: Array, longest: int) -> IntArray:
    """Give samples numbers by their time, so that those that are missing have numbers too.

    Parameters
    ----------
    time : array, shape (samples,), s
        Ascending; may jitter by less than half a step.
    longest : int
        Steps that no pause is longer than.

    Returns
    -------
    array of int, shape (samples,)
        From 0; ascending.
    """
    number = np.zeros(len(time), dtype=np.int64)
    number[1:] = np.cumsum(np.clip(_steps(time), 1, longest).astype(np.int64))
    return number


def lagged_pairs(number: IntArray, lag: int) -> tuple[IntArray, IntArray]:
    """Find the samples that are a lag apart.

    Parameters
    ----------
    number : array of int, shape (samples,)
        As from `sample_numbers`.
    lag : int
        Not negative.

    Returns
    -------
    earlier, later : array of int, shape (pairs,)
        Indices of samples.
    """
    later = np.searchsorted(number, number + lag)
    earlier = np.flatnonzero(later < len(number))
    earlier = earlier[number[later[earlier]] == number[earlier] + lag]
    return earlier, later[earlier]


def leading(source: TorqueSource, most: int) -> TorqueData:
    """Gather the first samples of a source in memory.

    Returns
    -------
    TorqueData
        All of them where there are not more.
    """
    return gathered(source, np.arange(min(len(source), most)))


def _steps(time: Array) -> Array:
    """Give the whole numbers of sample periods from one sample to the next, shape (samples - 1,)."""
    step = np.diff(time)
    return np.rint(step / median_filter(step, size=_STEPS_AROUND)) if len(step) else step
