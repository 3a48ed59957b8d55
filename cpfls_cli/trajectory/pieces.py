"""Closed forms of the pieces of a move: single waves of the pop, and holds between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.nesting import holds_of

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


@dataclass(frozen=True)
class Piece:
    """A wave or a hold, as functions of the fraction tau of its length.

    Attributes
    ----------
    start, length : float, s
    coefficients : array, shape (5, 8)
        Of displacement to snap: the powers of tau from 0 to 5, then sine and cosine of 2 pi tau.
    crackle, pop : float
        ``crackle (1 - cos)`` and ``pop sin``; zero in a hold.
    """

    start: float
    length: float
    coefficients: Array
    crackle: float
    pop: float

    @property
    def is_wave(self) -> bool:
        """Whether the crackle is not zero."""
        return self.crackle != 0

    @property
    def end(self) -> Array:
        """Displacement to snap at the end, shape (5,)."""
        end: Array = self.coefficients[:, :6].sum(axis=1) + self.coefficients[:, 7]
        return end

    def mirrored(self, parity: Array, displacement: float) -> Piece:
        """Make the piece of the second half of the move that mirrors this one, its time running backwards.

        Parameters
        ----------
        parity : array, shape (7,)
            Sign of each derivative of the mirror image.
        displacement : float, m
            Of the whole move.
        """
        coefficients = self.coefficients * parity[:5, np.newaxis]
        coefficients[0, 0] += displacement
        return replace(self, coefficients=coefficients, crackle=parity[5] * self.crackle, pop=parity[6] * self.pop)

    def evaluate(self, tau: Array, motion: Array) -> None:
        """Write displacement to pop.

        Parameters
        ----------
        tau : array, shape (time,)
            Fractions of the piece.
        motion : array, shape (7, time)
            To write to; holds zeros.
        """
        degree = 5 if self.is_wave else 4
        for order, row in enumerate(self.coefficients):
            _polynomial(row[: degree - order + 1], tau, motion[order])
        if self.is_wave:
            self._add_wave(tau, motion)

    def _add_wave(self, tau: Array, motion: Array) -> None:
        angle = _TURN * tau
        sine, cosine = np.sin(angle), np.cos(angle)
        for order, (_, wave) in enumerate(zip(motion, (sine, cosine, sine, cosine, sine), strict=False)):
            motion[order] += self.coefficients[order, 6 + order % 2] * wave
        np.multiply(cosine, -self.crackle, out=motion[5])
        motion[5] += self.crackle
        np.multiply(sine, self.pop, out=motion[6])


def pieces(peaks: Array, spans: Array) -> list[Piece]:
    """Cut the first half of a move into its pieces: eight waves, seven holds between and half the last hold.

    Parameters
    ----------
    peaks : array, shape (7,), m and s
        With the sign of the displacement; infinite where a derivative jumps.
    spans : array, shape (5,), s

    Returns
    -------
    list of Piece
        Without those that last no time.
    """
    lengths, signs = _lengths(spans), np.zeros(16)
    signs[0::2] = _SIGNS[:8]
    starts = np.cumsum(lengths) - lengths
    # What jumps does so inside pieces of no length, which nobody samples.
    bounded = np.where(np.isfinite(peaks), peaks, 0.0)
    known = _known_states(bounded)
    made: list[Piece] = []
    for start, length, sign, exact in zip(starts, lengths, signs, known, strict=True):
        state = made[-1].end if made else np.zeros(5)
        made.append(_piece(start, length, sign * bounded, np.where(np.isnan(exact), state, exact)))
    return [piece for piece in made if piece.length > 0]


def _lengths(spans: Array) -> Array:
    snap, jerk, acceleration, velocity = holds_of(spans)
    lengths = np.full(16, spans[0])
    lengths[1::4], lengths[3::8], lengths[7], lengths[15] = snap, jerk, acceleration, velocity / 2
    return lengths


def _known_states(peaks: Array) -> Array:
    """States at the starts that are exactly zero or a peak, not a number elsewhere, shape (16, 5).

    Derivative k, counted from the snap, has risen or fallen completely after every 2^(k - 1) waves.
    """
    known = np.full((16, 5), np.nan)
    for level in range(1, 5):
        blocks = np.arange(1, 16 // 2**level + 1)
        known[2**level * blocks - 1, 5 - level] = np.cumsum(_SIGNS)[blocks - 1] * peaks[5 - level]
    return known


def _piece(start: float, length: float, wave: Array, state: Array) -> Piece:
    """Carry a state through a piece; `wave` holds the signed peaks, zeros in a hold."""
    coefficients = np.zeros((5, 8))
    coefficients[:, 0] = state
    # Each derivative is the integral of the next; powers of a length alone could overflow.
    for order in (3, 2, 1, 0):
        coefficients[order, 1:5] = coefficients[order + 1, :4] * length / np.arange(1, 5)
    coefficients += np.cumprod([wave[4], *[length] * 4])[::-1, np.newaxis] * _WAVE
    return Piece(start, length, coefficients, wave[5] / 2, wave[6])


def _polynomial(coefficients: Array, tau: Array, values: Array) -> None:
    """Evaluate by Horner's rule, in place."""
    values[:] = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        values *= tau
        values += coefficient
