"""Noise passes, correlated residuals do not, and windows that share samples are not held against noise."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest

from cpfls_cli.gap.balance.windows import windows
from cpfls_cli.gap.residual.whiteness import whiteness

FLIGHT_INDEX = np.repeat([0, 1], 300)


def test_noise_seen_through_overlapping_windows_is_noise():
    through = windows(0.01, 0.4, 0.75)
    rng = np.random.default_rng(0)
    p_values = []
    for _ in range(60):
        rows = np.concatenate([through.average(rng.standard_normal((6040, 2))) for _ in range(2)])
        p_values += list(whiteness(rows, np.repeat([0, 1], len(rows) // 2), stride=4).p_value)
    assert kstest(p_values, "uniform").pvalue > 0.01
    assert whiteness(rows, np.repeat([0, 1], len(rows) // 2), stride=1).p_value.max() < 1e-6


def test_a_correlated_residual_is_not_noise_and_shows_its_correlation():
    rng = np.random.default_rng(1)
    rows = np.zeros((600, 6))
    rows[:, 0] = lfilter([1], [1, -0.9], rng.standard_normal(600))
    rows[:, 1] = rng.standard_normal(600) + 100.0 * FLIGHT_INDEX
    found = whiteness(rows, FLIGHT_INDEX)
    assert found.autocorrelation[0, 0] == pytest.approx(0.81, abs=0.08)
    assert found.p_value[0] < 1e-6
    assert found.p_value[1] > 0.01
    assert found.p_value[2:] == pytest.approx(1)
    assert (found.autocorrelation.shape, found.windows) == ((10, 6), 300)


def test_short_flights_have_fewer_lags():
    assert whiteness(np.ones((9, 6)), np.zeros(9, dtype=int)).autocorrelation.shape == (1, 6)
    empty = whiteness(np.ones((2, 6)), np.zeros(2, dtype=int))
    assert (empty.autocorrelation.shape, empty.p_value.tolist()) == ((0, 6), [1.0] * 6)
