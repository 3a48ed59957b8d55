"""Samples against a forward integration with sixty digits, over limits of six decades."""

from dataclasses import astuple

import numpy as np

from cpfls_cli.trajectory.limits import LIMIT_NAMES, Limits
from cpfls_cli.trajectory.moves import plan_moves
from tests.builders.exact_move import integrated


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
