"""Smooth windows: averages, derivatives without differentiating, and where they lie."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from scipy.interpolate import CubicSpline

from cpfls_cli.errors import InputError
from cpfls_cli.weak_form.windows import windows

TIME = 3.0 + 0.01 * np.arange(500)
LOCAL = np.array(TIME - 5.5)
THROUGH = windows(0.01, 0.4, 0.5)
CUBIC = st.lists(st.floats(-5, 5, allow_subnormal=False), min_size=4, max_size=4)


@given(CUBIC)
def test_integration_by_parts_is_exact_on_cubics(coefficients):
    cubic = Polynomial(coefficients)
    by_parts, direct = THROUGH.derivative(cubic(LOCAL)), THROUGH.average(cubic.deriv()(LOCAL))
    size = np.abs(coefficients).max() * 20
    np.testing.assert_allclose(by_parts, direct, atol=2e-5 * size + 1e-300)


@given(CUBIC)
def test_both_are_linear(coefficients):
    values = np.vander(LOCAL, 4)
    for applied in (THROUGH.average, THROUGH.derivative):
        np.testing.assert_allclose(applied(values @ coefficients), applied(values) @ coefficients, atol=1e-8)


def test_slope_is_the_derivative_of_the_window():
    place = 0.01 * np.arange(len(THROUGH.weight))
    np.testing.assert_allclose(CubicSpline(place, THROUGH.weight)(place, 1)[3:-3], THROUGH.slope[3:-3], rtol=2e-3)
    assert THROUGH.weight.sum() == pytest.approx(1)
    assert THROUGH.slope.sum() == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose(THROUGH.slope, -THROUGH.slope[::-1], atol=1e-12)


@pytest.mark.parametrize("samples", [8, 9, 40])
def test_the_derivative_of_time_is_1_however_few_samples_a_window_has(samples):
    window = windows(0.01, 0.01 * samples, 0.5)
    np.testing.assert_allclose(window.derivative(TIME), 1.0, rtol=1e-9)


def test_a_line_is_seen_at_the_centre_of_each_window():
    np.testing.assert_allclose(THROUGH.average(7 * TIME), 7 * THROUGH.centres(TIME))
    np.testing.assert_allclose(np.diff(THROUGH.centres(TIME)), 0.2)
    assert THROUGH.centres(TIME)[0] == pytest.approx(3.0 + 0.195)


def test_average_of_a_sine_falls_off_as_the_transform_of_the_window():
    """Slow sines pass and fast ones do not, which is why the window can do without a derivative."""
    gain = [np.abs(THROUGH.average(np.exp(2j * np.pi * f * TIME))).mean() for f in (0.5, 2.5, 12.5)]
    shape = np.sin(np.pi * np.linspace(0, 1, 4001)) ** 4
    place = np.linspace(-0.2, 0.2, 4001)
    expected = [abs((shape * np.exp(2j * np.pi * f * place)).sum()) / shape.sum() for f in (0.5, 2.5, 12.5)]
    np.testing.assert_allclose(gain, expected, atol=2e-3)
    assert gain[2] < 1e-3 < gain[1] < gain[0]


@pytest.mark.parametrize("samples", [0, 39, 40, 59, 60, 500])
def test_count_is_the_number_of_windows_that_fit(samples):
    fitting = [start for start in range(0, samples, 20) if start + 40 <= samples]
    assert THROUGH.count(samples) == len(fitting)
    if fitting:
        assert THROUGH.average(np.zeros((samples, 6, 2))).shape == (len(fitting), 6, 2)


def test_windows_of_few_samples_are_refused_by_name():
    with pytest.raises(InputError, match=r"gap.window_s = 0.05: holds 5 samples at 100 Hz; at least 8"):
        windows(0.01, 0.05, 0.5)
