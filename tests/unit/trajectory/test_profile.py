import numpy as np
import pytest

from cpfls_cli.trajectory import BaseProfile, Holds, covering

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
