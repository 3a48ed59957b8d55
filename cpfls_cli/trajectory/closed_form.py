"""The base move in closed form: its spans, holds and peaks, and samples of all its derivatives.

Every derivative is the ramp of the one below. With ``T1 = P``, ``T2 = T1 + Ts``, ``T3 = T1 + T2 + Tj``,
``T4 = T1 + T2 + T3 + Ta`` and ``T5 = T1 + T2 + T3 + T4 + Tv`` the peaks are ``s = A T1``, ``j = s T2``, ``a = j T3``,
``v = a T4``, ``D = v T5``, and the whole move lasts ``T1 + T2 + T3 + T4 + T5``. These are called spans here.

A move is sampled piece by piece, each half from its own end. A piece is a wave of the pop or a hold. Inside it every
derivative is a polynomial of the fraction tau of the piece, and in a wave a sine or a cosine besides. The second half
is the mirror image of the first, so that rounding errors are small against the peak of every derivative, and the end
is exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array

# A hold shorter than this fraction of its span is rounding error.
_NO_HOLD = 8 * float(np.finfo(float).eps)
# Samples of a block: what is computed on the way stays in the cache.
_BLOCK = 4096
# A move is odd about its middle: the derivatives of the second half, from those of the first.
_MIRROR = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
# The Thue-Morse sequence: the ramp up of every derivative is followed by its mirror image.
_SIGNS = np.array([1, -1, -1, 1, -1, 1, 1, -1, -1, 1, 1, -1, 1, -1, -1, 1], dtype=float)
_TURN = 2 * np.pi
# One wave from rest, for a snap of 1 and a period of 1: rows are displacement to snap, columns the powers of tau from
# 0 to 5, then sine and cosine of 2 pi tau.
_WAVE = np.array(
    [
        [0, _TURN**-4, 0, -(_TURN**-2) / 6, 0, 1 / 120, -(_TURN**-5), 0],
        [_TURN**-4, 0, -(_TURN**-2) / 2, 0, 1 / 24, 0, 0, -(_TURN**-4)],
        [0, -(_TURN**-2), 0, 1 / 6, 0, 0, _TURN**-3, 0],
        [-(_TURN**-2), 0, 1 / 2, 0, 0, 0, 0, _TURN**-2],
        [0, 1, 0, 0, 0, 0, -1 / _TURN, 0],
    ]
)


def spans_of(period: float | Array, holds: Array) -> Array:
    """Compute the spans T1 to T5, s, from period P and holds of snap, jerk, acceleration and velocity."""
    spans = np.empty((5, *holds.shape[1:]))
    spans[0] = period
    # A sum that overflows is infinite, and reported by the caller.
    with np.errstate(over="ignore"):
        for level in range(1, 5):
            spans[level] = spans[:level].sum(axis=0) + holds[level - 1]
    return spans


def holds_of(spans: Array) -> Array:
    """Compute the holds from the spans, the inverse of `spans_of`."""
    holds = spans[1:] - np.cumsum(spans, axis=0)[:-1]
    holds[holds <= _NO_HOLD * spans[1:]] = 0.0
    return holds


def peaks_of(displacement: float | Array, spans: Array) -> Array:
    """Compute the largest absolute displacement, velocity, acceleration, jerk, snap, crackle and pop, m and s.

    The first of the spans may be zero; what rises in no time has a derivative without bound. Section 7 of the paper;
    method.md section 3.
    """
    peaks = np.zeros((7, *spans.shape[1:]))
    peaks[0] = np.abs(displacement)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for order, span in enumerate(spans[::-1], start=1):
            peaks[order] = peaks[order - 1] / span
        peaks[6] = 2 * np.pi * peaks[5] / spans[0]
        peaks[5] *= 2
    return np.where(peaks[0] > 0, peaks, 0.0)


def sample(displacement: float, spans: Array, time: Array) -> Array:
    """Evaluate a move at any times: displacement, velocity, acceleration, jerk, snap, crackle, pop, shape (time, 7)."""
    if np.all(time[1:] >= time[:-1]):
        return _ascending(displacement, spans, time).T
    order = np.argsort(time, kind="stable")
    motion = np.empty((len(time), 7))
    motion[order] = _ascending(displacement, spans, time[order]).T
    return motion


def _ascending(displacement: float, spans: Array, time: Array) -> Array:
    """Evaluate at ascending times, shape (7, time)."""
    motion = np.zeros((7, len(time)))
    half = _pieces(np.copysign(peaks_of(displacement, spans), displacement), spans)
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


def _fill(motion: Array, piece: _Piece, time: Array, origin: float, direction: float) -> None:
    """Evaluate one piece, whose time runs from the origin in the direction."""
    for first in range(0, len(time), _BLOCK):
        block = slice(first, first + _BLOCK)
        elapsed = direction * (time[block] - origin)
        # Rounding of a large time may lie outside a short piece.
        piece.evaluate(np.clip(elapsed / piece.length, 0.0, 1.0), motion[:, block])


@dataclass(frozen=True)
class _Piece:
    """A wave or a hold, as functions of the fraction tau of its length.

    `coefficients` of displacement to snap, shape (5, 8): the powers of tau from 0 to 5, then sine and cosine of 2 pi
    tau; ``crackle (1 - cos)`` and ``pop sin``, zero in a hold.
    """

    start: float
    length: float
    coefficients: Array
    crackle: float
    pop: float

    @property
    def end(self) -> Array:
        """Displacement to snap at the end, shape (5,)."""
        end: Array = self.coefficients[:, :6].sum(axis=1) + self.coefficients[:, 7]
        return end

    def mirrored(self, parity: Array, displacement: float) -> _Piece:
        """Mirror this piece into the second half of the move, with its time reversed.

        `parity`: sign of each derivative of the mirror image; `displacement`: of the whole move.
        """
        coefficients = self.coefficients * parity[:5, np.newaxis]
        coefficients[0, 0] += displacement
        return replace(self, coefficients=coefficients, crackle=parity[5] * self.crackle, pop=parity[6] * self.pop)

    def evaluate(self, tau: Array, motion: Array) -> None:
        """Evaluate displacement to pop at fractions of the piece in place, into zeros of shape (7, time)."""
        is_wave = self.crackle != 0
        degree = 5 if is_wave else 4
        for order, row in enumerate(self.coefficients):
            _polynomial(row[: degree - order + 1], tau, motion[order])
        if not is_wave:
            return
        angle = _TURN * tau
        sine, cosine = np.sin(angle), np.cos(angle)
        for order, (_, wave) in enumerate(zip(motion, (sine, cosine, sine, cosine, sine), strict=False)):
            motion[order] += self.coefficients[order, 6 + order % 2] * wave
        np.multiply(cosine, -self.crackle, out=motion[5])
        motion[5] += self.crackle
        np.multiply(sine, self.pop, out=motion[6])


def _pieces(peaks: Array, spans: Array) -> list[_Piece]:
    """Cut the first half of a move into its pieces: eight waves, seven holds between and half the last hold."""
    snap, jerk, acceleration, velocity = holds_of(spans)
    lengths, signs = np.full(16, spans[0]), np.zeros(16)
    lengths[1::4], lengths[3::8], lengths[7], lengths[15] = snap, jerk, acceleration, velocity / 2
    signs[0::2] = _SIGNS[:8]
    starts = np.cumsum(lengths) - lengths
    # What jumps does so inside pieces of no length, which nobody samples.
    bounded = np.where(np.isfinite(peaks), peaks, 0.0)
    known = _known_states(bounded)
    made: list[_Piece] = []
    for start, length, sign, exact in zip(starts, lengths, signs, known, strict=True):
        state = made[-1].end if made else np.zeros(5)
        made.append(_piece(start, length, sign * bounded, np.where(np.isnan(exact), state, exact)))
    return [piece for piece in made if piece.length > 0]


def _known_states(peaks: Array) -> Array:
    """States at the starts that are exactly zero or a peak, not a number elsewhere, shape (16, 5).

    Derivative k, counted from the snap, has risen or fallen completely after every 2^(k - 1) waves.
    """
    known = np.full((16, 5), np.nan)
    for level in range(1, 5):
        blocks = np.arange(1, 16 // 2**level + 1)
        known[2**level * blocks - 1, 5 - level] = np.cumsum(_SIGNS)[blocks - 1] * peaks[5 - level]
    return known


def _piece(start: float, length: float, wave: Array, state: Array) -> _Piece:
    """Carry a state through a piece; `wave` holds the signed peaks, zeros in a hold."""
    coefficients = np.zeros((5, 8))
    coefficients[:, 0] = state
    # Each derivative is the integral of the next; powers of a length alone could overflow.
    for order in (3, 2, 1, 0):
        coefficients[order, 1:5] = coefficients[order + 1, :4] * length / np.arange(1, 5)
    coefficients += np.cumprod([wave[4], *[length] * 4])[::-1, np.newaxis] * _WAVE
    return _Piece(start, length, coefficients, wave[5] / 2, wave[6])


def _polynomial(coefficients: Array, tau: Array, values: Array) -> None:
    """Evaluate by Horner's rule, in place."""
    values[:] = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        values *= tau
        values += coefficient
