"""Whether a model misses less torque than its rival by more than chance: errors paired block by block."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.rigid_body import vertical
from cpfls_cli.identification.data import TorqueData, TorqueSource
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.validation.memory import block_count
from cpfls_cli.validation.paired import Comparison, block_means, compare

_ROUNDING = 1e-18


def compare_torque(
    source: TorqueSource, ours: Callable[[Motion], Array], theirs: Callable[[Motion], Array]
) -> Comparison:
    """Compare the errors of body torque over contiguous blocks of held-out data.

    There are as many blocks as `block_count` grants the errors. Errors are scaled by the root mean square of the
    torque about each axis, so that the smallest counts as much as the largest, and left out near a pitch of +-90
    degrees, as in `Score.r2_body`.

    Parameters
    ----------
    source : TorqueSource
        One held-out part.
    ours, theirs : callable
        Predict the generalised torque of a motion.
    """
    scale = _scale(source)
    chunks = (_errors(data, (ours, theirs)) for data in source.chunks())
    own, rival = (np.concatenate(errors) / scale for errors in zip(*chunks, strict=True))
    samples = len(own)
    block = np.arange(samples) * block_count(np.hstack([own, rival])) // max(samples, 1)
    ours_by_block, theirs_by_block = (block_means(np.sum(errors**2, axis=1), block) for errors in (own, rival))
    # Each of three axes has a mean square of 1 after scaling.
    return compare(ours_by_block, theirs_by_block, size=3.0)


def _errors(data: TorqueData, torques: tuple[Callable[[Motion], Array], ...]) -> list[Array]:
    """Errors of body torque of each predictor, shape (told samples, 3)."""
    told = ~vertical(data.motion.attitude)
    attitude = data.motion.attitude[told]
    return [rotations.body_torque(attitude, (data.torque - torque(data.motion))[told]) for torque in torques]


def _scale(source: TorqueSource) -> Array:
    """Root mean square of the body torque; an axis without torque counts by the size of the largest."""
    square, count = np.zeros(3), 0
    for data in source.chunks():
        told = ~vertical(data.motion.attitude)
        square += np.sum(rotations.body_torque(data.motion.attitude[told], data.torque[told]) ** 2, axis=0)
        count += int(np.sum(told))
    size = square / max(count, 1)
    return np.sqrt(np.where(size > _ROUNDING * np.max(size), size, np.max(size) or 1.0))
