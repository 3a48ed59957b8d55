import numpy as np
import pytest

from cpfls_cli.trajectory.limits import Limits
from cpfls_cli.trajectory.profile import BaseProfile, Holds
from cpfls_cli.trajectory.time_optimal import plan_move


@pytest.fixture
def profile():
    return BaseProfile(amplitude=2.0, period=0.5, holds=Holds(snap=0.1, jerk=0.2, acceleration=0.3, velocity=0.4))


def test_times_may_come_in_any_order(profile):
    time = np.linspace(-1.0, profile.duration + 1, 5000)
    order = np.random.default_rng(0).permutation(len(time))
    np.testing.assert_array_equal(profile.sample(time[order]), profile.sample(time)[order])


def test_a_sample_does_not_depend_on_its_neighbours(profile):
    time = np.linspace(0, profile.duration, 40_001)
    some = np.arange(0, len(time), 997)
    scale = np.abs(profile.sample(time)).max(axis=0)
    np.testing.assert_allclose(profile.sample(time)[some] / scale, profile.sample(time[some]) / scale, atol=1e-15)


def test_no_times_give_no_samples(profile):
    assert profile.sample(np.empty(0)).shape == (0, 7)


def test_the_end_is_exact_after_long_holds():
    # Four decades lie between every limit and the next; summing forward loses eight digits of the velocity here.
    move = plan_move(1e3, Limits(velocity=1e-1, acceleration=1e3, jerk=1e7, snap=1e11, pop=1e22))
    end = np.nextafter(move.duration, 0.0)
    last = move.profile.sample(np.array([end, move.duration]))
    np.testing.assert_array_equal(last[1], [1e3, 0, 0, 0, 0, 0, 0])
    assert abs(last[0, 0] - 1e3) <= 1e-12 * 1e3
    assert abs(last[0, 1:3] / [move.peaks.velocity, move.peaks.acceleration]).max() <= 1e-12


def test_stretched_keeps_shape_and_displacement(profile):
    slow = profile.stretched(2 * profile.duration)
    assert slow.duration == pytest.approx(2 * profile.duration, rel=1e-15)
    time = np.linspace(0, profile.duration, 300)
    expected = profile.sample(time) / 2.0 ** np.arange(7)
    np.testing.assert_allclose(slow.sample(2 * time), expected, atol=1e-12)
