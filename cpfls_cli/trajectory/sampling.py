"""Sample a move fast: piece by piece in closed form, each half from its own end.

A piece is a wave of the pop or a hold. Inside it every derivative is a polynomial of the fraction tau of the piece,
and in a wave a sine or a cosine besides. The second half is the mirror image of the first, so that what rounding
leaves is small against the peak of every derivative, and the end is exact.
"""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.nesting import peaks_of
from cpfls_cli.trajectory.pieces import Piece, pieces

# Samples of a block: what is computed on the way stays in the cache.
_BLOCK = 4096
# A move is odd about its middle: the derivatives of the second half, from those of the first.
_MIRROR = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def sample(displacement: float, spans: Array, time: Array) -> Array:
    """Evaluate a move and its derivatives.

    Parameters
    ----------
    displacement : float, m
    spans : array, shape (5,), s
        T1 to T5.
    time : array, shape (time,), s
        Any order.

    Returns
    -------
    array, shape (time, 7), m and s
        Displacement, velocity, acceleration, jerk, snap, crackle, pop.
    """
    if np.all(time[1:] >= time[:-1]):
        return _ascending(displacement, spans, time).T
    order = np.argsort(time, kind="stable")
    motion = np.empty((len(time), 7))
    motion[order] = _ascending(displacement, spans, time[order]).T
    return motion


def _ascending(displacement: float, spans: Array, time: Array) -> Array:
    """Evaluate at ascending times, shape (7, time)."""
    motion = np.zeros((7, len(time)))
    half = pieces(np.copysign(peaks_of(displacement, spans), displacement), spans)
    duration = spans.sum()
    starts = np.array([piece.start for piece in half])
    breaks = np.concatenate([starts, [duration / 2], duration - starts[::-1]])
    bounds = np.searchsorted(time, np.maximum.accumulate(breaks))
    for piece, first, last in zip(half, bounds[: len(half)], bounds[1:], strict=False):
        _fill(motion[:, first:last], piece, time[first:last], piece.start, 1.0)
    for piece, first, last in zip(half[::-1], bounds[len(half) : -1], bounds[len(half) + 1 :], strict=True):
        backwards = piece.mirrored(_MIRROR, displacement)
        _fill(motion[:, first:last], backwards, time[first:last], duration - piece.start, -1.0)
    motion[0, bounds[-1] :] = displacement
    return motion


def _fill(motion: Array, piece: Piece, time: Array, origin: float, direction: float) -> None:
    """Evaluate one piece, whose time runs from the origin in the direction."""
    for first in range(0, len(time), _BLOCK):
        block = slice(first, first + _BLOCK)
        elapsed = direction * (time[block] - origin)
        # Rounding of a large time may lie outside a short piece.
        piece.evaluate(np.clip(elapsed / piece.length, 0.0, 1.0), motion[:, block])
