"""Stretches of samples without a pause, and the leading samples of a long source."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.identification.data import TorqueData, TorqueSource, gathered

# Jitter moves a sample by less than half a step; a sample that is missing makes two steps of one.
_LONGEST_STEP = 1.5


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
        From 0; a new number behind every step of more than one and a half usual ones.
    """
    number = np.zeros(len(time), dtype=np.int64)
    number[1:] = np.cumsum(np.diff(time) > _LONGEST_STEP * sample_period(time))
    return number


def leading(source: TorqueSource, most: int) -> TorqueData:
    """Gather the first samples of a source in memory.

    Parameters
    ----------
    source : TorqueSource
    most : int

    Returns
    -------
    TorqueData
        All of them where there are not more.
    """
    return gathered(source, np.arange(min(len(source), most)))
