"""Whether a model errs less than its rival by more than chance: both compared block by block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from cpfls_cli.arrays import Array, IntArray

_FEWEST_BLOCKS = 4
_CONFIDENCE = 0.975
# What two solutions of the same equations may differ by, and rounding as a share of what is predicted, squared.
_SAME, _ROUNDING = 1e-6, 1e-18


@dataclass(frozen=True)
class Comparison:
    """Errors of a model beside those of a rival.

    Attributes
    ----------
    ours, theirs : float
        Mean squared errors.
    ratio : float
        ``ours / theirs``; 1 where they differ by no more than rounding, infinite where theirs alone are rounding.
    lower, higher : bool
        Whether ours are lower, or higher, by more than chance: so is the mean over all blocks, and the mean logarithm
        of the ratio by block is outside its 95 % interval about 0.
    blocks : int
    """

    ours: float
    theirs: float
    ratio: float
    lower: bool
    higher: bool
    blocks: int


def compare(ours: Array, theirs: Array, size: float) -> Comparison:
    """Compare mean squared errors by Student's test of the paired logarithms.

    Logarithms, since errors differ from block to block by orders of magnitude, and one bad block should neither decide
    nor, by the scatter that it makes, hide that all the others agree.

    Parameters
    ----------
    ours, theirs : array, shape (blocks,)
        Of the same blocks.
    size : float
        Mean square of what is predicted; errors below 1e-18 of it are rounding.

    Returns
    -------
    Comparison
        Neither lower nor higher with fewer than four blocks, which can prove nothing.
    """
    if len(ours) == 0:
        return Comparison(float("nan"), float("nan"), 1.0, False, False, 0)
    mean, rival, rounding = float(np.mean(ours)), float(np.mean(theirs)), _ROUNDING * size
    apart = mean - rival
    if abs(apart) <= _SAME * rival + rounding:
        return Comparison(mean, rival, 1.0, False, False, len(ours))
    least = max(rounding, np.finfo(float).tiny)
    logarithm = np.log(np.maximum(ours, least) / np.maximum(theirs, least))
    typical, chance = float(np.mean(logarithm)), _chance(logarithm)
    ratio = mean / rival if rival > rounding else float("inf")
    return Comparison(mean, rival, ratio, apart < 0 and typical < -chance, apart > 0 and typical > chance, len(ours))


def _chance(values: Array) -> float:
    """Half the width of the 95 % interval of a mean; infinite for too few."""
    if len(values) < _FEWEST_BLOCKS:
        return float("inf")
    return float(student.ppf(_CONFIDENCE, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values)))


def block_means(errors: Array, block: IntArray) -> Array:
    """Average errors by block.

    Parameters
    ----------
    errors : array, shape (n,)
    block : array of int, shape (n,)
        Of each error, from 0.

    Returns
    -------
    array, shape (blocks that have any,)
    """
    counts = np.bincount(block)
    return np.asarray(np.bincount(block, weights=errors)[counts > 0] / counts[counts > 0])
