"""The jackknife against what is known of a mean, and blocks of equal length."""

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.blocks import contiguous, half_width, jackknife_covariance, jackknife_error, mean_error, serial_error


@pytest.fixture
def values():
    return np.random.default_rng(2).standard_normal((12, 3)) @ np.triu(np.ones((3, 3)))


def test_of_a_mean_the_jackknife_says_what_its_standard_error_says(values):
    left_out = (values.sum(axis=0) - values) / (len(values) - 1)
    np.testing.assert_allclose(jackknife_error(left_out), mean_error(values), rtol=1e-12)
    np.testing.assert_allclose(jackknife_covariance(left_out), np.cov(values.T) / len(values), rtol=1e-12)
    assert jackknife_error(left_out[:, 0]) == pytest.approx(mean_error(values)[0])


@pytest.mark.parametrize(("memory", "plain"), [(0.01, 0.95), (2.0, 0.87)])
def test_intervals_hold_where_neighbouring_blocks_correlate(memory, plain):
    """Means of a Gauss-Markov process in 30 blocks, four or two of its memories long, against its known mean."""
    rng, keep = np.random.default_rng(3), np.exp(-0.1 / memory)
    drawn = rng.standard_normal((3000, 1300)) * np.sqrt(1 - keep**2)
    blocks = lfilter([1.0], [1.0, -keep], drawn)[:, 100:].reshape(3000, 30, 40).mean(axis=2)
    left_out = ((blocks.sum(axis=1, keepdims=True) - blocks) / 29).T
    error = np.abs(blocks.mean(axis=1))
    held = [np.mean(error < half_width(of(left_out), 30)) for of in (jackknife_error, serial_error)]
    assert held[0] == pytest.approx(plain, abs=0.02)
    assert held[1] == pytest.approx(0.955 if memory < 1 else 0.92, abs=0.015)


def test_intervals_are_those_of_students_t():
    assert half_width(np.array([2.0]), 10) == pytest.approx(2 * 2.262157)


@pytest.mark.parametrize(("samples", "blocks"), [(10, 3), (7, 7), (3, 5), (0, 4)])
def test_blocks_are_contiguous_and_about_equal(samples, blocks):
    number = contiguous(samples, blocks)
    assert len(number) == samples
    if samples:
        sizes = np.bincount(number, minlength=blocks)
        assert (np.diff(number) >= 0).all()
        assert np.ptp(sizes) <= 1
