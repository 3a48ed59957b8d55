"""Residual analysis against formulas written out, on errors whose nature is known."""

import numpy as np
import pytest
from scipy.stats import binom, chi2

from cpfls_cli.identification.data import TorqueData, joined
from cpfls_cli.regressor import Motion
from cpfls_cli.validation.residuals import examine_residuals
from cpfls_cli.validation.stretches import leading, sample_period, stretch_numbers

AXES = 3


def flight(errors, seed=0, **motion):
    """A flight whose torque is the errors that a model without torque makes."""
    rng = np.random.default_rng(seed)
    parts = {"attitude": 0.3, "rate": 1.0, "acceleration": 2.0}
    drawn = {name: size * rng.standard_normal(errors.shape) for name, size in parts.items()}
    return TorqueData(0.01 * np.arange(len(errors)), Motion(**(drawn | motion)), errors)


def examined(source, lags=50):
    return examine_residuals("held out", source, lambda motion: np.zeros((len(motion), AXES)), lags)


def autocorrelation_by_hand(errors, lags):
    own = errors - errors.mean()
    return np.array([own[lag:] @ own[:-lag] for lag in range(1, lags + 1)]) / (own @ own)


@pytest.fixture(scope="module")
def white():
    """A hundred analyses of white noise."""
    rng = np.random.default_rng(41)
    return [examined(flight(rng.standard_normal((2000, AXES)), seed)) for seed in range(100)]


def test_the_band_flags_one_lag_of_white_noise_in_twenty(white):
    outside = np.array([np.abs(found.autocorrelation) > found.band for found in white])
    least, most = binom.interval(0.9999, outside.size, 0.05)
    assert least < np.sum(outside) < most
    # The band of a popular library, 1.96 / sqrt(2 N - 1), would flag three times as many.
    wrong = np.array([np.abs(found.autocorrelation) > 1.96 / np.sqrt(2 * found.samples - 1) for found in white])
    assert np.mean(wrong) > 0.13


def test_white_noise_passes_the_test_of_ljung_and_box_as_often_as_it_should(white):
    small = np.array([found.ljung_box < 0.05 for found in white])
    least, most = binom.interval(0.9999, small.size, 0.05)
    assert least < np.sum(small) < most


def test_ljung_box_by_its_formula():
    errors = np.cumsum(np.random.default_rng(42).standard_normal((300, AXES)), axis=0) * 0.05
    errors += np.random.default_rng(43).standard_normal(errors.shape)
    found = examined(flight(errors), lags=12)
    for axis in range(AXES):
        expected = autocorrelation_by_hand(errors[:, axis], 12)
        np.testing.assert_allclose(found.autocorrelation[:, axis], expected, rtol=1e-12, atol=1e-14)
        statistic = 300 * 302 * np.sum(expected**2 / (300 - np.arange(1, 13)))
        assert found.ljung_box[axis] == pytest.approx(chi2.sf(statistic, 12), rel=1e-9)
    np.testing.assert_allclose(found.lag, 0.01 * np.arange(1, 13))
    assert found.band == pytest.approx(1.96 / np.sqrt(300))


def test_errors_that_remember_are_not_white():
    noise = np.random.default_rng(44).standard_normal((2000, AXES))
    found = examined(flight(noise + np.roll(noise, 1, axis=0)))
    assert np.all(found.ljung_box < 1e-6)
    np.testing.assert_allclose(found.autocorrelation[0], 0.5, atol=0.05)


def test_nothing_is_correlated_across_the_pause_between_flights():
    """The second flight is the first again: across the pause the correlation at its length would be one."""
    errors = np.random.default_rng(45).standard_normal((60, AXES))
    found = examined(joined([flight(errors), flight(errors)]), lags=10)
    for axis in range(AXES):
        np.testing.assert_allclose(found.autocorrelation[:, axis], autocorrelation_by_hand(errors[:, axis], 10))
    assert found.samples == 120


@pytest.mark.parametrize("delay", [7, -4, 0])
def test_an_error_that_follows_an_input_shows_at_its_delay(delay):
    signal = np.random.default_rng(46).standard_normal(1500)
    rate = 0.5 * np.random.default_rng(47).standard_normal((1500, AXES))
    rate[:, 1] = signal
    errors = 1e-3 * np.random.default_rng(48).standard_normal((1500, AXES))
    errors[:, 2] -= 0.02 * np.roll(signal, delay)
    found = examined(flight(errors, rate=rate), lags=10)
    own = found.correlation[found.input.index("pitch rate"), :, 2]
    assert found.input_lag[np.argmax(np.abs(own))] == pytest.approx(0.01 * delay)
    assert np.min(own) < -0.98
    assert np.max(np.abs(found.correlation[found.input.index("pitch rate"), :, :2])) < 0.12


def test_correlation_without_delay_is_pearson_s():
    errors = np.random.default_rng(49).standard_normal((200, AXES))
    data = flight(errors)
    found = examined(data, lags=3)
    expected = np.corrcoef(data.motion.acceleration[:, 0], errors[:, 1])[0, 1]
    assert found.correlation[found.input.index("roll acceleration"), 3, 1] == pytest.approx(expected, rel=1e-12)
    assert found.correlation.shape == (len(found.input), 7, AXES)
    assert found.correlation[found.input.index("yaw torque"), 3, 2] == pytest.approx(1.0)


def test_nothing_follows_an_input_that_stays_what_it_is():
    rate = np.random.default_rng(50).standard_normal((200, AXES))
    rate[:, 2] = 0.7 + 1e-14 * rate[:, 0]
    found = examined(flight(np.random.default_rng(54).standard_normal((200, AXES)), rate=rate), lags=3)
    constant = np.isnan(found.correlation).all(axis=(1, 2))
    assert [name for name, own in zip(found.input, constant, strict=True) if own] == ["yaw rate"]


def test_rounding_is_not_called_coloured():
    rng = np.random.default_rng(51)
    torque = rng.standard_normal((500, AXES)) * [5.0, 1.0, 0.1]
    data = flight(torque)
    slow = 1e-12 * np.sin(0.01 * np.arange(500))[:, None] * [1.0, 1.0, 0.0]
    found = examine_residuals("x", data, lambda _: torque + slow + [0.0, 0.0, 1.0] * torque, 20)
    np.testing.assert_array_equal(found.exact, [True, True, False])
    assert np.isnan(found.ljung_box[:2]).all()
    assert np.isfinite(found.ljung_box[2])
    assert np.isnan(found.autocorrelation[:, :2]).all()
    assert np.isnan(found.correlation[:, :, :2]).all()


def test_no_torque_and_no_error_at_all():
    found = examined(flight(np.zeros((50, AXES))))
    assert found.exact.all()
    np.testing.assert_array_equal(found.histogram_count.sum(axis=0), 50)


def test_histogram_and_quantiles():
    errors = np.random.default_rng(52).standard_normal((4000, AXES)) * [1.0, 2.0, 0.5]
    found = examined(flight(errors))
    np.testing.assert_array_equal(found.histogram_count.sum(axis=0), 4000)
    np.testing.assert_allclose(found.histogram_edge[-1], np.abs(errors).max(axis=0))
    np.testing.assert_allclose(found.histogram_edge, -found.histogram_edge[::-1], atol=1e-12)
    slope = [np.polyfit(found.normal_quantile, own, 1)[0] for own in found.quantile.T]
    np.testing.assert_allclose(slope, [1.0, 2.0, 0.5], rtol=0.05)


def test_a_pause_starts_a_stretch_and_jitter_does_not():
    time = np.arange(20) * 0.01 + np.random.default_rng(53).uniform(-0.002, 0.002, 20)
    time[12:] += 0.01
    np.testing.assert_array_equal(stretch_numbers(time), np.repeat([0, 1], [12, 8]))
    np.testing.assert_array_equal(stretch_numbers(time[:1]), [0])
    assert np.isnan(sample_period(time[:1]))


def test_a_long_source_is_cut():
    data = flight(np.ones((30, AXES)))
    assert len(leading(data, 12)) == 12
    assert len(leading(data, 100)) == 30
