"""Whether a model replays windows of a flight with less error than its rival by more than chance."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.validation.paired import Comparison, block_means, compare

# How much worse than any run that comes to its end one is that does not.
_LOST = 10.0


def compare_windows(ours: Array, theirs: Array, size: float, block: IntArray) -> Comparison:
    """Compare the errors of windows that do not overlap, block by block.

    A window that one of both lost counts as ten times the largest error of all; one that both lost is left out.

    Parameters
    ----------
    ours, theirs : array, shape (window,)
        Mean squared errors, not finite where a run was lost.
    size : float
        Mean square of what is predicted.
    block : array of int, shape (window,)
        Of each window.

    Returns
    -------
    Comparison
        Without blocks where no window is left.
    """
    both, told = np.stack([ours, theirs]), np.isfinite(ours) | np.isfinite(theirs)
    worst = _LOST * max(float(np.max(both[np.isfinite(both)], initial=0.0)), size)
    own, rival = (block_means(errors[told], block[told]) for errors in np.where(np.isfinite(both), both, worst))
    return compare(own, rival, size)


def apart(start: IntArray, horizon: int) -> IntArray:
    """Choose windows that do not overlap, from the first on.

    Parameters
    ----------
    start : array of int, shape (window,)
        First sample, ascending.
    horizon : int
        Samples behind it.

    Returns
    -------
    array of int
        Their numbers.
    """
    chosen, free = [], 0
    for number, first in enumerate(start):
        if first >= free:
            chosen.append(number)
            free = int(first) + horizon
    return np.array(chosen, dtype=np.int64)
