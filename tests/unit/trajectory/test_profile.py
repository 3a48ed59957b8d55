import numpy as np
import pytest

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


def test_covering_chooses_the_amplitude():
    assert covering(64.0, 1.0, Holds()).amplitude == pytest.approx(1.0, rel=1e-14)
    assert covering(10.0, 0.7, Holds(jerk=0.3, velocity=2.0)).peaks.displacement == pytest.approx(10.0, rel=1e-14)


@pytest.fixture
def profile():
    return BaseProfile(amplitude=2.0, period=0.5, holds=Holds(snap=0.1, jerk=0.2, acceleration=0.3, velocity=0.4))


def test_a_sample_does_not_depend_on_its_neighbours(profile):
    time = np.linspace(0, profile.duration, 40_001)
    some = np.arange(0, len(time), 997)
    scale = np.abs(profile.sample(time)).max(axis=0)
    np.testing.assert_allclose(profile.sample(time)[some] / scale, profile.sample(time[some]) / scale, atol=1e-15)


def test_stretched_keeps_shape_and_displacement(profile):
    slow = profile.stretched(2 * profile.duration)
    assert slow.duration == pytest.approx(2 * profile.duration, rel=1e-15)
    time = np.linspace(0, profile.duration, 300)
    expected = profile.sample(time) / 2.0 ** np.arange(7)
    np.testing.assert_allclose(slow.sample(2 * time), expected, atol=1e-12)
