"""Blocks of neighbouring samples, which stand for independent ones: how they are cut, and how far they scatter."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray

FEWEST_BLOCKS = 4
"""That give an error, if a wide one: Student's t of three is 4.3."""
ENOUGH_BLOCKS = 8
"""Whose scatter decides: fewer leave the error itself open by more than a quarter."""
MOST_COMPARED, MOST_BLOCKS = 20, 24
"""Of predictions that are compared, and of estimates: the work grows with them, longer ones are surer independent, and
intervals by Student's t are 6 % wider than for infinitely many."""
BLOCK_S = 4.0
"""Length of blocks: longer than what noise, gusts and motion remember."""
_CONFIDENCE = 0.975
"""Two-sided 95 %."""


def block_length(seconds: float, longest: float = BLOCK_S, shortest: float = 2.0, wanted: int = 9) -> float:
    """Choose how long the blocks of so many seconds are, s: of short flights they are shorter, so that some remain."""
    return min(longest, max(seconds / wanted, shortest))


def contiguous(samples: int, blocks: int) -> IntArray:
    """Cut samples into blocks of about equal length: the number of the block of each, shape (samples,)."""
    return np.arange(samples, dtype=np.int64) * blocks // max(samples, 1)


def blocks_of_time(samples: int, period: float) -> IntArray:
    """Cut evenly spaced samples, a period in s apart, into blocks as long as these have to be, and enough of them."""
    seconds = samples * period
    return contiguous(samples, min(max(FEWEST_BLOCKS, round(seconds / block_length(seconds))), max(samples, 1)))


def leaving_out(compute: Callable[[BoolArray], Array], samples: int, blocks: int) -> tuple[Array, Array]:
    """Compute numbers from the samples that are kept: from all, and without each of so many contiguous blocks."""
    block = contiguous(samples, blocks)
    without = [compute(np.asarray(block != number)) for number in range(blocks)]
    return compute(np.ones(samples, dtype=bool)), np.array(without)


def jackknife_covariance(left_out: Array) -> Array:
    """Compute the covariance of numbers from their values without each block.

    It holds whatever correlates within blocks, and for noise of unequal size.

    Parameters
    ----------
    left_out : array, shape (block, number)

    Returns
    -------
    array, shape (number, number)

    References
    ----------
    Efron and Tibshirani 1993, chapter 11 (delete-a-group jackknife); Kunsch 1989.
    """
    blocks, apart = len(left_out), left_out - left_out.mean(axis=0)
    return np.asarray((blocks - 1) / blocks * (apart.T @ apart))


def jackknife_error(left_out: Array) -> Array:
    """Compute the standard errors of numbers from their values without each block, shape (block, ...) to (...)."""
    blocks, apart = len(left_out), left_out - left_out.mean(axis=0)
    return np.asarray(np.sqrt((blocks - 1) / blocks * (apart**2).sum(axis=0)))


def serial_error(left_out: Array) -> Array:
    """Compute the same where neighbouring blocks may correlate: what is as slow as a few blocks, such as gusts.

    Parameters
    ----------
    left_out : array, shape (block, ...)
        In the order of time.

    References
    ----------
    Newey and West 1987, with one lag that counts whole where it is positive.
    """
    apart = left_out - left_out.mean(axis=0)
    alike = (apart[1:] * apart[:-1]).sum(axis=0)
    own = np.maximum((apart**2).sum(axis=0), np.finfo(float).tiny)
    return np.asarray(jackknife_error(left_out) * np.sqrt(1.0 + 2.0 * np.maximum(alike, 0.0) / own))


def mean_error(values: Array) -> Array:
    """Compute the standard error of the mean of two or more independent values, shape (value, ...) to (...)."""
    return np.asarray(np.std(values, axis=0, ddof=1) / np.sqrt(len(values)))


def half_width(error: Array, blocks: int | IntArray, confidence: float = _CONFIDENCE) -> Array:
    """Compute half of an interval, 95 % two-sided, from a standard error of so many blocks, by Student's t.

    Parameters
    ----------
    confidence : float
        Probability of its upper end, below 1.
    """
    # Slow to load for who cuts blocks alone.
    from scipy.special import stdtrit

    return np.asarray(stdtrit(blocks - 1, confidence) * error)
