"""Samples against a forward integration with 60 digits, over limits of six decades."""

from dataclasses import astuple
from decimal import Decimal, localcontext
from math import factorial

import numpy as np
import pytest

from cpfls_cli.trajectory.limits import LIMIT_NAMES, Limits
from cpfls_cli.trajectory.time_optimal import plan_moves

TURN = 2 * Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640629")
# Sine and cosine of a quarter, a half, three quarters and the whole of a wave.
QUARTERS = {"0.25": (1, 0), "0.5": (0, -1), "0.75": (-1, 0), "1": (0, 1)}


def sequence(profile):
    """Signs and lengths by nesting: every rise, its hold, its fall."""
    pieces = [(1, Decimal(profile.period))]
    for length in map(Decimal, astuple(profile.holds)):
        pieces = [*pieces, (0, length), *[(-sign, duration) for sign, duration in pieces]]
    return [(sign, length) for sign, length in pieces if length]


def coasted(state, time):
    return [sum(value * time**k / factorial(k) for k, value in enumerate(state[order:5])) for order in range(5)]


def waved(state, time, frequency, amplitude, sine, cosine):
    """Add to a coasting state the integrals of ``amplitude (1 - cos)``."""
    f, t = frequency, time
    wave = [
        t**5 / 120 - t**3 / (6 * f**2) + t / f**4 - sine / f**5,
        t**4 / 24 - t**2 / (2 * f**2) + (1 - cosine) / f**4,
        t**3 / 6 - t / f**2 + sine / f**3,
        t**2 / 2 - (1 - cosine) / f**2,
        t - sine / f,
    ]
    moved = [rest + amplitude * part for rest, part in zip(coasted(state, t), wave, strict=True)]
    return [*moved, amplitude * (1 - cosine), amplitude * f * sine]


def integrated(profile):
    """Times and states in every piece, from the amplitude that covers the displacement."""
    spans = []
    for hold in (profile.period, *astuple(profile.holds)):
        spans.append(sum(spans) + Decimal(hold))
    amplitude = Decimal(profile.displacement)
    for span in spans:
        amplitude /= span
    start, state, times, states = Decimal(0), [Decimal(0)] * 7, [], []
    for sign, length in sequence(profile):
        for fraction, (sine, cosine) in QUARTERS.items():
            elapsed = length * Decimal(fraction)
            if sign:
                ahead = waved(state, elapsed, TURN / length, sign * amplitude, sine, cosine)
            else:
                ahead = [*coasted(state, elapsed), Decimal(0), Decimal(0)]
            times.append(float(start + elapsed))
            states.append([float(value) for value in ahead])
        start, state = start + length, ahead
    return np.array(times), np.array(states)


@pytest.fixture(scope="module")
def profiles():
    rng = np.random.default_rng(3)
    count = 60
    limits = 10 ** rng.uniform(-3, 3, (6, count))
    limits[:5][rng.random((5, count)) < 0.2] = np.inf
    moves = plan_moves(10 ** rng.uniform(-3, 3, count), Limits(**dict(zip(LIMIT_NAMES, limits, strict=True))))
    return [move.profile for move in moves]


def test_samples_are_the_integral_of_the_pop(profiles):
    for profile in profiles:
        with localcontext(prec=60):
            times, states = integrated(profile)
        peaks = np.array(astuple(profile.peaks))
        slopes = np.append(peaks[1:], peaks[6] * 2 * np.pi / profile.period)
        # A time of type float may be off by a rounding of the duration.
        tolerance = 1e-12 * peaks + 4 * np.finfo(float).eps * profile.duration * slopes
        inside = times < profile.duration
        assert (np.abs(profile.sample(times[inside]) - states[inside]) <= tolerance).all()
        assert abs(states[-1, 0] - profile.displacement) <= 1e-12 * profile.displacement
        assert (np.abs(states[-1, 1:]) <= 1e-12 * peaks[1:]).all()
