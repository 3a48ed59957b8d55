"""Samples against a forward integration with sixty digits, over limits of six decades."""

from __future__ import annotations

from dataclasses import astuple
from decimal import Decimal, localcontext
from math import factorial

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.trajectory.legs import plan_moves
from cpfls_cli.trajectory.profile import LIMIT_NAMES, BaseProfile, Limits

_TURN = 2 * Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640629")
# Sine and cosine after a quarter, a half, three quarters and the whole of a wave.
_QUARTERS = {"0.25": (1, 0), "0.5": (0, -1), "0.75": (-1, 0), "1": (0, 1)}


def integrated(profile: BaseProfile) -> tuple[Array, Array]:
    """Integrate the pop from rest, at the quarters of every wave and hold.

    Parameters
    ----------
    profile : BaseProfile
        With a period greater than zero.

    Returns
    -------
    times : array, shape (time,), s
    states : array, shape (time, 7), m and s
        Displacement to pop; the last row is the end.
    """
    with localcontext(prec=60):
        amplitude = _amplitude(profile)
        start, state, times, states = Decimal(0), [Decimal(0)] * 7, [], []
        for sign, length in _sequence(profile):
            for fraction, (sine, cosine) in _QUARTERS.items():
                elapsed = length * Decimal(fraction)
                wave = _wave(elapsed, _TURN / length, sine, cosine)
                coast = _coasted(state, elapsed)
                ahead = [rest + sign * amplitude * part for rest, part in zip(coast, wave, strict=True)]
                times.append(float(start + elapsed))
                states.append([float(value) for value in ahead])
            start, state = start + length, ahead
    return np.array(times), np.array(states)


def _amplitude(profile: BaseProfile) -> Decimal:
    """Divide the displacement by all five spans, each of which is the sum of those before and a hold."""
    spans: list[Decimal] = []
    for hold in (profile.period, *astuple(profile.holds)):
        spans.append(sum(spans, Decimal(hold)))
    amplitude = Decimal(profile.displacement)
    for span in spans:
        amplitude /= span
    return amplitude


def _sequence(profile: BaseProfile) -> list[tuple[int, Decimal]]:
    """Nest signs and lengths: every rise, its hold, its fall."""
    pieces = [(1, Decimal(profile.period))]
    for length in map(Decimal, astuple(profile.holds)):
        pieces = [*pieces, (0, length), *[(-sign, duration) for sign, duration in pieces]]
    return [(sign, length) for sign, length in pieces if length]


def _coasted(state: list[Decimal], t: Decimal) -> list[Decimal]:
    taylor = [sum(value * t**k / factorial(k) for k, value in enumerate(state[order:5])) for order in range(5)]
    return [*taylor, Decimal(0), Decimal(0)]


def _wave(t: Decimal, f: Decimal, sine: int, cosine: int) -> list[Decimal]:
    """Integrals of ``1 - cos(f t)``, from five to none, and its slope."""
    return [
        t**5 / 120 - t**3 / (6 * f**2) + t / f**4 - sine / f**5,
        t**4 / 24 - t**2 / (2 * f**2) + (1 - cosine) / f**4,
        t**3 / 6 - t / f**2 + sine / f**3,
        t**2 / 2 - (1 - cosine) / f**2,
        t - sine / f,
        Decimal(1 - cosine),
        f * sine,
    ]


def test_samples_are_the_integral_of_the_pop():
    rng = np.random.default_rng(3)
    count = 60
    limits = 10 ** rng.uniform(-3, 3, (6, count))
    limits[:5][rng.random((5, count)) < 0.2] = np.inf
    moves = plan_moves(10 ** rng.uniform(-3, 3, count), Limits(**dict(zip(LIMIT_NAMES, limits, strict=True))))
    for move in moves:
        times, states = integrated(move.profile)
        peaks = np.array(astuple(move.peaks))
        slopes = np.append(peaks[1:], peaks[6] * 2 * np.pi / move.profile.period)
        # A time of type float may be off by a rounding of the duration.
        tolerance = 1e-12 * peaks + 4 * np.finfo(float).eps * move.duration * slopes
        inside = times < move.duration
        assert (np.abs(move.profile.sample(times[inside]) - states[inside]) <= tolerance).all()
        assert abs(states[-1, 0] - move.profile.displacement) <= 1e-12 * peaks[0]
        assert (np.abs(states[-1, 1:]) <= 1e-12 * peaks[1:]).all()
