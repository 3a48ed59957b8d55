"""How long errors remember each other, and how many blocks of them are independent."""

from __future__ import annotations

import numpy as np
from scipy import fft

from cpfls_cli.arrays import Array

BLOCKS = 20
"""Blocks at most: enough for a test."""

_SHORTEST_BLOCK = 20
# Neighbouring blocks of four correlation times share little of what is common to their errors.
_CORRELATION_TIMES = 4
_MOST_SAMPLES = 200_000


def block_count(errors: Array) -> int:
    """Count the contiguous blocks that errors can be cut into and still be independent of each other.

    Each block has 20 samples at least, and four correlation times of the errors.

    Parameters
    ----------
    errors : array, shape (samples, signals)
        In the order of time.

    Returns
    -------
    int
        1 to 20.
    """
    longest = max(_SHORTEST_BLOCK, _CORRELATION_TIMES * correlation_time(errors[:_MOST_SAMPLES]))
    return min(max(len(errors) // longest, 1), BLOCKS)


def correlation_time(signals: Array) -> int:
    """Give the lag from which on no signal has an autocorrelation above 1/e for the first time.

    Parameters
    ----------
    signals : array, shape (samples, signals)

    Returns
    -------
    int
        Samples; 0 where nothing varies.
    """
    if len(signals) == 0:
        return 0
    centred = signals - np.mean(signals, axis=0)
    # Twice the length, so that the end is not correlated with the start.
    spectrum = fft.rfft(centred, fft.next_fast_len(2 * len(signals), real=True), axis=0)
    covariance = fft.irfft(np.abs(spectrum) ** 2, axis=0)[: len(signals)]
    return int(np.max(np.argmax(covariance <= covariance[0] / np.e, axis=0)))
