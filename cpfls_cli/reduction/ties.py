"""The rule for ties: the lowest index."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray

# Equal samples get scores that differ by rounding, depending on where in the array they stand.
TIE_TOLERANCE = 1e-10


def first_best(scores: Array, available: BoolArray) -> int:
    """Find the lowest available index whose score is the largest one up to rounding.

    Parameters
    ----------
    scores : array, shape (samples,)
    available : array of bool, shape (samples,)
    """
    allowed = np.where(available, scores, -np.inf)
    best = allowed.max()
    return int(np.argmax(allowed >= best - TIE_TOLERANCE * abs(best)))
