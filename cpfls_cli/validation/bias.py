"""Whether errors have a mean beyond chance, which no autocorrelation shows."""

from __future__ import annotations

import numpy as np
from scipy.stats import t as student

from cpfls_cli.arrays import Array, BoolArray

# Few enough that a block outlasts the memory of most noise, and enough for a test.
_BLOCKS = 20
_FEWEST_BLOCKS, _FEWEST_SAMPLES = 4, 50


def mean_p_value(errors: Array, without: BoolArray) -> Array:
    """Test whether errors are 0 in the mean, by Student's test of their means over blocks of time.

    ``t = m / (s / sqrt B)`` with m the mean and s the standard deviation of the B block means. Neighbouring errors are
    alike where filters were at work, so that they count as fewer than they are; means over long blocks are not.

    Parameters
    ----------
    errors : array, shape (samples, 3)
        In the order of time.
    without : array of bool, shape (3,)
        Axes without errors.

    Returns
    -------
    array, shape (3,)
        Small where the mean is not 0; NaN for an axis without errors, and for all of fewer than four samples.
    """
    blocks = min(max(len(errors) // _FEWEST_SAMPLES, _FEWEST_BLOCKS), _BLOCKS)
    if len(errors) < blocks:
        return np.full(errors.shape[1], np.nan)
    means = np.array([own.mean(axis=0) for own in np.array_split(errors, blocks)])
    middle, spread = means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(blocks)
    # A constant without any noise is not chance.
    ratio = np.where(middle == 0, 0.0, np.abs(middle) / np.maximum(spread, np.finfo(float).tiny))
    return np.where(without, np.nan, 2 * student.sf(ratio, blocks - 1))
