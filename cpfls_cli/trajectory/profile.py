"""The base move: rest to rest along a line, whose sixth derivative is a sequence of single sine waves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.pulses import carry, pulse

# The Thue-Morse sequence: the ramp up of every derivative is followed by its mirror image.
_SIGNS = np.array([1, -1, -1, 1, -1, 1, 1, -1, -1, 1, 1, -1, 1, -1, -1, 1], dtype=float)


@dataclass(frozen=True, kw_only=True)
class Holds:
    """How long a derivative stays at its peak, s.

    Attributes
    ----------
    snap, jerk, acceleration, velocity : float, s
        Duration of each hold; a move holds snap 8 times, jerk 4 times, acceleration twice, velocity once.
    """

    snap: float = 0.0
    jerk: float = 0.0
    acceleration: float = 0.0
    velocity: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Peaks:
    """Largest absolute value of every derivative of a move, in m and s.

    Attributes
    ----------
    displacement, velocity, acceleration, jerk, snap, crackle, pop : float
        Derivatives zero to six of the displacement.
    """

    displacement: float
    velocity: float
    acceleration: float
    jerk: float
    snap: float
    crackle: float
    pop: float


@dataclass(frozen=True, kw_only=True)
class BaseProfile:
    """A rest-to-rest move with pop ``+-A (2 pi / P) sin(2 pi t / P)`` in sixteen intervals, and holds between.

    Attributes
    ----------
    amplitude : float, m/s^5
        A; the crackle is ``A (1 - cos(2 pi t / P))``.
    period : float, s
        P, the length of one interval.
    holds : Holds
        Pauses between the intervals, during which snap, jerk, acceleration or velocity stays at its peak.

    References
    ----------
    Section 7 of the paper; method.md section 3.
    """

    amplitude: float
    period: float
    holds: Holds = Holds()

    @property
    def duration(self) -> float:
        """Duration of the move in s, ``16 P + 8 Ts + 4 Tj + 2 Ta + Tv``."""
        holds = self.holds
        return 16 * self.period + 8 * holds.snap + 4 * holds.jerk + 2 * holds.acceleration + holds.velocity

    @property
    def peaks(self) -> Peaks:
        """Largest absolute values in closed form; they nest, so a limit on each is one inequality."""
        P, holds = self.period, self.holds
        snap = self.amplitude * P
        jerk = snap * (P + holds.snap)
        acceleration = jerk * (2 * P + holds.snap + holds.jerk)
        velocity = acceleration * (4 * P + 2 * holds.snap + holds.jerk + holds.acceleration)
        stretch = 8 * P + 4 * holds.snap + 2 * holds.jerk + holds.acceleration + holds.velocity
        return Peaks(
            displacement=velocity * stretch,
            velocity=velocity,
            acceleration=acceleration,
            jerk=jerk,
            snap=snap,
            crackle=2 * self.amplitude,
            pop=2 * np.pi * self.amplitude / P,
        )

    def sample(self, time: Array) -> Array:
        """Evaluate the move in closed form.

        Parameters
        ----------
        time : array, shape (time,), s
            Any order; at rest before 0 and after `duration`.

        Returns
        -------
        array, shape (time, 7), m and s
            Displacement, velocity, acceleration, jerk, snap, crackle, pop.
        """
        lengths, signs = _segments(self.period, self.holds)
        starts = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
        states = _initial_states(self.amplitude * signs, lengths, self.period)
        segment = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(starts) - 1)
        elapsed = time - starts[segment]
        heights = self.amplitude * signs[segment]
        motion = carry(states[segment], elapsed) + heights[:, None] * pulse(elapsed, self.period)
        motion[(time < 0) | (time >= self.duration)] = 0.0
        motion[time >= self.duration, 0] = self.peaks.displacement
        return motion


def covering(displacement: float, period: float, holds: Holds) -> BaseProfile:
    """Choose the amplitude that covers a displacement exactly.

    Parameters
    ----------
    displacement : float, m
    period : float, s
    holds : Holds

    Returns
    -------
    BaseProfile
        Of infinite amplitude where the period is too short for any number.
    """
    reached = BaseProfile(amplitude=1.0, period=period, holds=holds).peaks.displacement
    return BaseProfile(amplitude=displacement / reached if reached else np.inf, period=period, holds=holds)


def _segments(period: float, holds: Holds) -> tuple[Array, Array]:
    """Lengths and signs of the 16 intervals and the 15 holds between them (sign 0)."""
    lengths, signs = np.full(31, period), np.zeros(31)
    signs[0::2] = _SIGNS
    lengths[1::4] = holds.snap
    lengths[3::8] = holds.jerk
    lengths[7::16] = holds.acceleration
    lengths[15] = holds.velocity
    return lengths, signs


def _initial_states(heights: Array, lengths: Array, period: float) -> Array:
    states = np.zeros((len(lengths), 7))
    gains = heights[:, None] * pulse(lengths, period)
    for index in range(len(lengths) - 1):
        end = carry(states[index : index + 1], lengths[index : index + 1])[0] + gains[index]
        # Crackle and pop vanish at the end of a whole wave; only rounding is left of them.
        states[index + 1, :5] = end[:5]
    return states
