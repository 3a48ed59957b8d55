"""Contiguous blocks of a training part: what is drawn, or turned, as one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.identification.data import TorqueSource, sample_times

_DEFAULT_BLOCKS = 40
_MOST_BLOCKS = 200
_FEWEST_BLOCKS = 2

# Shorter blocks are no longer independent of their neighbours where noise is coloured.
_FEWEST_SAMPLES = 20


@dataclass(frozen=True)
class TimeBlocks:
    """Blocks of equal numbers of training samples.

    Attributes
    ----------
    starts : array, shape (blocks - 1,), s
        Where every block but the first begins.
    duration : float, s
        Of one block.
    """

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
    """Cut a training part into blocks.

    Parameters
    ----------
    training : TorqueSource
    block_duration : float or None, s
        None: a fortieth of the training part. There are 2 to 200 blocks; above two, each has 20 samples at least, so a
        short flight has fewer blocks than asked for, and a long one longer blocks.
    most : int, optional
        Blocks at most, where there is memory for fewer than 200.
    """
    time = sample_times(training)
    samples = len(time)
    step = float(np.median(np.diff(time))) if samples > 1 else 0.0
    asked = _DEFAULT_BLOCKS if block_duration is None else round(samples * step / block_duration)
    count = min(asked, _MOST_BLOCKS, most, samples // _FEWEST_SAMPLES)
    count = min(max(count, _FEWEST_BLOCKS), samples)
    return TimeBlocks(time[np.arange(1, count) * samples // count], samples * step / count)
