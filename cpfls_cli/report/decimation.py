"""Thin out long curves so that no peak is lost."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, IntArray

LARGEST = 1500
ROWS = 25
"""Of a table of the data of a figure, at most."""


def kept_samples(values: Array, largest: int = LARGEST) -> IntArray:
    """Choose the samples that draw a curve: the lowest and the highest of every stretch, and both ends.

    Parameters
    ----------
    values : array, shape (samples,)
    largest : int
        About how many samples to keep; a shorter curve is kept whole.

    Returns
    -------
    array of int
        Ascending indices.
    """
    samples = len(values)
    if samples <= largest:
        return np.arange(samples)
    stretch = np.arange(samples) * (largest // 2) // samples
    order = np.lexsort((values, stretch))
    ends = np.searchsorted(stretch[order], np.arange(largest // 2), side="right")
    starts = np.concatenate([[0], ends[:-1]])
    return np.unique(np.concatenate([order[starts], order[ends - 1], [0, samples - 1]]))


def evenly_spread(samples: int, rows: int = ROWS) -> IntArray:
    """Choose the samples of a curve that a table shows: both ends and some between.

    Parameters
    ----------
    rows : int
        At most so many.

    Returns
    -------
    array of int
        Ascending indices.
    """
    return np.unique(np.linspace(0, max(samples - 1, 0), min(samples, rows)).round().astype(int))


def runs(marked: Array) -> list[tuple[int, int]]:
    """Find stretches of marked samples.

    Parameters
    ----------
    marked : array, shape (samples,)
        Other than zero where marked.

    Returns
    -------
    list of (int, int)
        First and last index of each.
    """
    edges = np.diff(np.concatenate([[0], (np.asarray(marked) != 0).astype(int), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))
