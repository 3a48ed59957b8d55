"""Samples in the order of time: stretches without a pause, lags, contiguous blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.identification.data import TorqueSource, sample_times

# Flights of several sample rates may follow each other, and samples may be missing: as many steps around each tell
# what is usual there.
_STEPS_AROUND = 25

# By default enough that Student's t is that of a normal distribution; more than 200 take time and tell no more.
_DEFAULT_BLOCKS, _MOST_BLOCKS, _FEWEST_BLOCKS = 40, 200, 2

# Shorter blocks are no longer independent of their neighbours where noise is coloured.
_FEWEST_SAMPLES = 20


def sample_period(time: Array) -> float:
    """Compute the usual (median) time from one sample to the next, s; NaN for a single sample."""
    return float(np.median(np.diff(time))) if len(time) > 1 else float("nan")


def stretch_numbers(time: Array) -> IntArray:
    """Label every sample by its stretch from 0, in which samples follow each other without a pause.

    Times ascend and may jitter by less than half a step; a pause is a step of more than one and a half of those usual
    around it.
    """
    number = np.zeros(len(time), dtype=np.int64)
    number[1:] = np.cumsum(_steps(time) > 1)
    return number


def sample_numbers(time: Array, longest: int) -> IntArray:
    """Count samples from 0 by their time, so that missing ones are counted too.

    Times ascend and may jitter by less than half a step; no pause counts as more than `longest` steps.
    """
    number = np.zeros(len(time), dtype=np.int64)
    number[1:] = np.cumsum(np.clip(_steps(time), 1, longest).astype(np.int64))
    return number


def lagged_pairs(number: IntArray, lag: int) -> tuple[IntArray, IntArray]:
    """Find the indices of pairs of samples, numbered as by `sample_numbers`, that are a lag of 0 or more apart."""
    later = np.searchsorted(number, number + lag)
    earlier = np.flatnonzero(later < len(number))
    earlier = earlier[number[later[earlier]] == number[earlier] + lag]
    return earlier, later[earlier]


def _steps(time: Array) -> Array:
    """Round the steps to whole numbers of sample periods from one sample to the next, shape (samples - 1,)."""
    step = np.diff(time)
    return np.rint(step / median_filter(step, size=_STEPS_AROUND)) if len(step) else step


@dataclass(frozen=True)
class TimeBlocks:
    """Blocks of equal numbers of training samples: where each but the first begins, and how long one lasts, s."""

    starts: Array
    duration: float

    def number(self, time: Array) -> IntArray:
        """Find the block of each sample, from 0, by its time in s."""
        return np.searchsorted(self.starts, time, side="right").astype(np.int64)

    def labels(self, source: TorqueSource) -> IntArray:
        """Label each sample of a source by its block, from 0; blocks without samples are not counted."""
        number = self.number(sample_times(source))
        label = np.cumsum(np.bincount(number) > 0) - 1
        return np.asarray(label[number])


def time_blocks(training: TorqueSource, block_duration: float | None, most: int = _MOST_BLOCKS) -> TimeBlocks:
    """Cut a training part into blocks of a duration in s; None: a fortieth of it.

    There are 2 to 200 blocks, or `most` where there is memory for fewer; above two, each has 20 samples at least, so a
    short flight has fewer blocks than asked for, and a long one longer blocks.
    """
    time = sample_times(training)
    samples = len(time)
    step = float(np.median(np.diff(time))) if samples > 1 else 0.0
    asked = _DEFAULT_BLOCKS if block_duration is None else round(samples * step / block_duration)
    count = min(asked, _MOST_BLOCKS, most, samples // _FEWEST_SAMPLES)
    count = min(max(count, _FEWEST_BLOCKS), samples)
    return TimeBlocks(time[np.arange(1, count) * samples // count], samples * step / count)
