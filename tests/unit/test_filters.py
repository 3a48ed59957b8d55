"""Filters beside those of `scipy.signal`, which the program does not wait for."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter, lfilter_zi, savgol_filter, sosfiltfilt

from cpfls_cli.filters import SecondOrder, butterworth, parabolas, recursion
from cpfls_cli.flightlog.smoothing import low_pass

WAVES = np.random.default_rng(1).standard_normal((400, 3)) + np.array([0.0, 5.0, -80.0])


@pytest.mark.parametrize("past", [[-0.9], [0.3 - 0.2j], [-1.8, 0.82], np.array([0.1, 0.2, 0.3])])
@pytest.mark.parametrize("values", [WAVES, WAVES[:, 0], WAVES[:1], WAVES * (1 + 0.1j), WAVES.reshape(100, 4, 3)])
def test_a_recursion_is_that_of_scipy(past, values):
    np.testing.assert_allclose(recursion(past, values), lfilter([1.0], [1.0, *past], values, axis=0), atol=1e-10)


@pytest.mark.parametrize("upper", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.5, 1.0, 2.0)])
def test_a_filter_begins_settled(upper):
    made = SecondOrder.of(0.01, 0.3, upper)
    state = lfilter_zi(made.over, made.under)[:, None] * WAVES[0]
    np.testing.assert_allclose(made.settled(WAVES[0]), state, atol=1e-9)
    expected = lfilter(made.over, made.under, WAVES, axis=0, zi=state)[0]
    np.testing.assert_allclose(made.along(WAVES), expected, atol=1e-9)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 7, 12])
@pytest.mark.parametrize("cutoff_hz", [0.3, 10.0, 49.0])
def test_a_low_pass_is_the_butterworth_filter_of_scipy(order, cutoff_hz):
    padding = min(len(WAVES) - 1, int(np.ceil(3 * 100.0 / cutoff_hz)))
    designed = butter(order, cutoff_hz, fs=100.0, output="sos")
    expected = sosfiltfilt(designed, WAVES, axis=0, padlen=padding)
    np.testing.assert_allclose(low_pass(WAVES, 100.0, cutoff_hz, order), expected, atol=1e-8)
    assert len(butterworth(cutoff_hz / 100.0, order)) == len(designed)


@pytest.mark.parametrize("derivative", [0, 1])
@pytest.mark.parametrize("samples", [5, 21])
def test_parabolas_are_those_of_scipy(samples, derivative):
    expected = savgol_filter(WAVES, samples, 2, derivative, axis=0)
    np.testing.assert_allclose(parabolas(WAVES, samples // 2, derivative), expected, atol=1e-11)
