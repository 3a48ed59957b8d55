"""The base move: rest to rest along a line, whose sixth derivative is a sequence of single sine waves; its limits.

Every derivative is the ramp of the one below. With ``T1 = P``, ``T2 = T1 + Ts``, ``T3 = T1 + T2 + Tj``,
``T4 = T1 + T2 + T3 + Ta`` and ``T5 = T1 + T2 + T3 + T4 + Tv`` the peaks are ``s = A T1``, ``j = s T2``, ``a = j T3``,
``v = a T4``, ``D = v T5``, and the whole move lasts ``T1 + T2 + T3 + T4 + T5``. These are called spans here.

A move is sampled piece by piece, each half from its own end. A piece is a wave of the pop or a hold. Inside it every
derivative is a polynomial of the fraction tau of the piece, and in a wave a sine or a cosine besides. The second half
is the mirror image of the first, so that rounding errors are small against the peak of every derivative, and the end
is exact.
"""

from __future__ import annotations

import math
from dataclasses import asdict, astuple, dataclass, fields, replace
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.polynomial.polynomial import polyval
from typing_extensions import Doc

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings

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
            motion[order] = polyval(tau, row[: degree - order + 1])
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


@dataclass(frozen=True, kw_only=True)
class Holds:
    """Time for which each derivative stays at its peak, s.

    A move holds snap 8 times, jerk 4 times, acceleration twice, velocity once.
    """

    snap: float = 0.0
    jerk: float = 0.0
    acceleration: float = 0.0
    velocity: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Peaks:
    """Largest absolute value of every derivative of a move, in m and s."""

    displacement: float
    velocity: float
    acceleration: float
    jerk: float
    snap: float
    crackle: float
    pop: float


_DERIVATIVES = tuple(field.name for field in fields(Peaks))


@dataclass(frozen=True, kw_only=True)
class BaseProfile:
    """A rest-to-rest move with pop ``+-A (2 pi / P) sin(2 pi t / P)`` in sixteen intervals, and holds between.

    The amplitude A is in m/s^5; the crackle is ``A (1 - cos(2 pi t / P))``. It is infinite where the period P, the
    length of one interval in s, is zero, so that the snap jumps. The displacement follows from the amplitude where it
    is not given; `covering` gives both. Section 7 of the paper; method.md section 3.
    """

    amplitude: float
    period: float
    holds: Holds = Holds()
    displacement: float = math.nan

    def __post_init__(self) -> None:
        """Compute the displacement where it is not given."""
        if math.isnan(self.displacement):
            object.__setattr__(self, "displacement", self.amplitude * _product(self.spans))

    @property
    def spans(self) -> Array:
        """Durations T1 to T5, shape (5,), s: snap, jerk, ..., displacement is the one before times its span."""
        return spans_of(self.period, np.array(astuple(self.holds)))

    @property
    def duration(self) -> float:
        """Duration of the move in s, ``16 P + 8 Ts + 4 Tj + 2 Ta + Tv``."""
        return float(self.spans.sum())

    @property
    def peaks(self) -> Peaks:
        """Largest absolute values in closed form; they nest, so a limit on each is one inequality."""
        values = peaks_of(self.displacement, self.spans).tolist()
        return Peaks(**dict(zip(_DERIVATIVES, values, strict=True)))

    @property
    def integral_of_absolute_jerk(self) -> float:
        """The paper's measure of energy, m/s^2: four times the peak of the acceleration, with or without holds."""
        return 4 * self.peaks.acceleration

    def sample(self, time: Array) -> Array:
        """Evaluate the move in closed form, every derivative to rounding error of its own peak.

        Parameters
        ----------
        time : array, shape (time,), s
            Any order, fastest when it ascends; at rest before 0 and from `duration` on.

        Returns
        -------
        array, shape (time, 7), m and s
            Displacement, velocity, acceleration, jerk, snap, crackle, pop. A derivative without bound is zero
            but at the instants at which the one below jumps.
        """
        return sample(self.displacement, self.spans, time)

    def stretched(self, duration: float) -> BaseProfile:
        """Cover the same displacement in another time, with the same shape.

        Derivative n is smaller by the ratio of the durations to the power of n.
        """
        factor = duration / self.duration
        holds = Holds(**{name: factor * hold for name, hold in asdict(self.holds).items()})
        return covering(self.displacement, factor * self.period, holds)


def covering(displacement: float, period: float, holds: Holds) -> BaseProfile:
    """Choose the amplitude that covers a displacement exactly; infinite where the period is too short for any number.

    A negative displacement moves backwards; the period may be zero, if a hold is not.
    """
    reached = _product(spans_of(period, np.array(astuple(holds))))
    unbounded = math.copysign(math.inf, displacement) if displacement else 0.0
    amplitude = displacement / reached if reached else unbounded
    return BaseProfile(amplitude=amplitude, period=period, holds=holds, displacement=displacement)


def _product(spans: Array) -> float:
    # A product that overflows is infinite, and refused by the caller.
    with np.errstate(over="ignore", under="ignore"):
        return float(np.prod(spans))


_Positive = Annotated[float, Gt(0)]
_Limit = _Positive | tuple[_Positive, _Positive, _Positive] | None


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Largest absolute value allowed to each derivative of a move, in m and s; infinite where there is none.

    An array gives every move its own limit.
    """

    velocity: float | Array = np.inf
    acceleration: float | Array = np.inf
    jerk: float | Array = np.inf
    snap: float | Array = np.inf
    crackle: float | Array = np.inf
    pop: float | Array = np.inf

    def __post_init__(self) -> None:
        """Refuse limits that are zero, negative or no numbers."""
        for field in fields(self):
            require_positive(field.name, getattr(self, field.name), "leave it out for no limit")

    def broadcast(self, moves: int) -> Array:
        """Broadcast the limits to all moves, shape (6, moves); `SettingError` where a length fits neither."""
        return np.stack([broadcast_to_moves(field.name, getattr(self, field.name), moves) for field in fields(self)])


LIMIT_NAMES = tuple(field.name for field in fields(Limits))


def require_positive(key: str, value: float | Array, remedy: str) -> None:
    """Refuse values that are not greater than zero, with their name and what else could be done about it."""
    values = np.atleast_1d(np.asarray(value, dtype=np.float64))
    wrong = ~(values > 0)
    if wrong.any():
        raise SettingError(key, f"is {values[wrong][0]:g}; must be greater than 0, or {remedy}")


def broadcast_to_moves(key: str, value: float | Array, moves: int) -> Array:
    """Broadcast one value to all moves; `SettingError` where it is neither one nor one for each."""
    values = np.asarray(value, dtype=np.float64)
    if values.shape not in ((), (1,), (moves,)):
        raise SettingError(key, f"has shape {values.shape} for {moves} moves; give one value, or one for each move")
    return np.broadcast_to(values, (moves,))


@dataclass(frozen=True, kw_only=True)
class LimitSettings(Settings):
    """Limit the derivatives of every move; a number for all, or one for each of x, y, z, or null for none."""

    velocity_m_s: Annotated[_Limit, Doc("largest velocity, m/s")] = None
    acceleration_m_s2: Annotated[_Limit, Doc("largest acceleration, m/s^2")] = None
    jerk_m_s3: Annotated[_Limit, Doc("largest jerk, m/s^3")] = None
    snap_m_s4: Annotated[_Limit, Doc("largest snap, m/s^4")] = None
    crackle_m_s5: Annotated[_Limit, Doc("largest crackle, m/s^5")] = None
    pop_m_s6: Annotated[_Limit, Doc("largest pop, m/s^6")] = None

    @property
    def given(self) -> dict[str, float | tuple[float, float, float]]:
        """The limits that are not null, by key."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {key: value for key, value in values.items() if value is not None}

    def of_axes(self, axes: IntArray) -> Limits:
        """Limits of some of the axes x, y, z, each for itself; every entry has the shape of `axes`, (n,)."""
        return Limits(**{_derivative(key): np.broadcast_to(value, 3)[axes] for key, value in self.given.items()})

    def along(self, direction: Array) -> Limits:
        """Limits on a move along a straight line.

        Parameters
        ----------
        direction : array, shape (3,)
            World vector that one metre of the move moves along. Limits axis by axis hold for each component, a
            single number for the move itself.
        """
        return Limits(**{_derivative(key): _along(value, direction) for key, value in self.given.items()})


def _derivative(key: str) -> str:
    return key.split("_", 1)[0]


def _along(value: float | tuple[float, float, float], direction: Array) -> float:
    if not isinstance(value, tuple):
        return value
    moving = direction != 0
    return float(np.min(np.array(value)[moving] / np.abs(direction[moving])))
