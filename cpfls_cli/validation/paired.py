"""Whether a model errs less than its rival by more than chance: both compared block by block."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.physics import vertical
from cpfls_cli.regressor.motion import Motion

BLOCKS = 20
"""Few enough that a block outlasts the memory of most noise, and enough for a test."""

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


def compare_torque(
    parts: Mapping[str, TorqueSource], ours: Callable[[Motion], Array], theirs: Callable[[Motion], Array]
) -> Comparison | None:
    """Compare the errors of body torque over blocks of held-out data.

    Each part is cut into 20 blocks. Errors are scaled by the root mean square of the torque about each axis, so that
    the smallest counts as much as the largest, and left out near a pitch of +-90 degrees, as in `Score.r2_body`.

    Parameters
    ----------
    parts : mapping of str to TorqueSource
        Held-out data.
    ours, theirs : callable
        Predict the generalised torque of a motion.

    Returns
    -------
    Comparison or None
        None without held-out data.
    """
    if not parts:
        return None
    by_part = [_block_errors(source, (ours, theirs)) for source in parts.values()]
    own, rival = np.concatenate(by_part, axis=1)
    # Each of three axes has a mean square of 1 after scaling.
    return compare(own, rival, size=3.0)


def compare_windows(ours: Array, theirs: Array, size: float) -> Comparison:
    """Compare errors of windows in the order of time, which may overlap, over 20 blocks of windows.

    Parameters
    ----------
    ours, theirs : array, shape (window,)
        Mean squared errors, not finite where a run was lost; such windows are left out.
    size : float
        Mean square of what is predicted.

    Returns
    -------
    Comparison
    """
    told = np.isfinite(ours) & np.isfinite(theirs)
    blocks = [block for block in np.array_split(np.flatnonzero(told), BLOCKS) if len(block)]
    own, rival = (np.array([np.mean(errors[block]) for block in blocks]) for errors in (ours, theirs))
    return compare(own, rival, size)


def _block_errors(source: TorqueSource, torques: tuple[Callable[[Motion], Array], ...]) -> Array:
    """Mean squared scaled error, shape (predictor, block), of the blocks that have any sample to tell."""
    sums, square, counts, start = np.zeros((len(torques), BLOCKS, 3)), np.zeros(3), np.zeros(BLOCKS), 0
    for data in source.chunks():
        told = np.flatnonzero(~vertical(data.motion.attitude))
        attitude, block = data.motion.attitude[told], (start + told) * BLOCKS // len(source)
        for own, torque in zip(sums, torques, strict=True):
            error = data.torque[told] - torque(data.motion)[told]
            np.add.at(own, block, rotations.body_torque(attitude, error) ** 2)
        square += np.sum(rotations.body_torque(attitude, data.torque[told]) ** 2, axis=0)
        counts += np.bincount(block, minlength=BLOCKS)
        start += len(data)
    size = square / max(np.sum(counts), 1.0)
    # An axis without torque counts by the size of the largest.
    size = np.where(size > _ROUNDING * np.max(size), size, np.max(size) or 1.0)
    told_blocks = counts > 0
    return np.asarray(np.sum(sums[:, told_blocks] / size, axis=2) / counts[told_blocks])
