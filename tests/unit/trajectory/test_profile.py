import numpy as np
import pytest

from cpfls_cli.trajectory.limits import Limits
from cpfls_cli.trajectory.moves import plan_move
from cpfls_cli.trajectory.profile import BaseProfile, Holds, covering

PRINTED = [64.0, 8.0, 2.0, 1.0, 1.0, 2.0, 2 * np.pi]


@pytest.fixture
def unit_profile():
    return BaseProfile(amplitude=1.0, period=1.0)


def test_peaks_are_the_printed_ones(unit_profile):
    peaks = unit_profile.peaks
    values = [peaks.displacement, peaks.velocity, peaks.acceleration, peaks.jerk, peaks.snap, peaks.crackle, peaks.pop]
    np.testing.assert_allclose(values, PRINTED, rtol=1e-12)
    assert unit_profile.duration == 16.0


def test_samples_reach_the_printed_maxima(unit_profile):
    time = np.arange(16 * 8 + 1) / 8
    np.testing.assert_allclose(np.abs(unit_profile.sample(time)).max(axis=0), PRINTED, rtol=1e-12)


def test_integral_of_absolute_jerk_is_eight(unit_profile):
    # Jerk changes sign at multiples of 4 s only, so its integral is a sum of steps of the acceleration.
    acceleration = unit_profile.sample(np.arange(0.0, 17.0, 2.0))[:, 2]
    assert np.abs(np.diff(acceleration)).sum() == pytest.approx(8.0, abs=1e-12)


def test_move_ends_at_rest_before_the_end_is_imposed(unit_profile):
    almost = unit_profile.sample(np.array([np.nextafter(16.0, 0.0)]))[0]
    np.testing.assert_allclose(almost, [64.0, 0, 0, 0, 0, 0, 0], atol=1e-12)


def test_rest_before_and_after(unit_profile):
    motion = unit_profile.sample(np.array([-3.0, 0.0, 16.0, 40.0]))
    np.testing.assert_array_equal(motion[:2], 0.0)
    np.testing.assert_array_equal(motion[2:], [[64.0, 0, 0, 0, 0, 0, 0]] * 2)


def test_holds_keep_their_derivative_at_its_peak():
    profile = BaseProfile(amplitude=2.0, period=0.5, holds=Holds(snap=1.0, jerk=2.0, acceleration=3.0, velocity=4.0))
    middles = np.array([0.5 + 0.5, 2.0 + 1.0, 6.0 + 1.5, 15.0 + 2.0])
    motion = profile.sample(middles)
    peaks = profile.peaks
    held = [motion[0, 4], motion[1, 3], motion[2, 2], motion[3, 1]]
    np.testing.assert_allclose(held, [peaks.snap, peaks.jerk, peaks.acceleration, peaks.velocity], rtol=1e-12)


def test_covering_chooses_the_amplitude():
    assert covering(64.0, 1.0, Holds()).amplitude == pytest.approx(1.0, rel=1e-14)
    assert covering(10.0, 0.7, Holds(jerk=0.3, velocity=2.0)).peaks.displacement == pytest.approx(10.0, rel=1e-14)


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
