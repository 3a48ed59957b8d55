"""Residual analysis against formulas written out, on errors whose nature is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal
from scipy.stats import binom, chi2, kstest

from cpfls_cli.identification.data import TorqueData, joined
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.validation import residuals
from cpfls_cli.validation.residuals import examine_residuals

AXES = 3


def flight_of_errors(errors, seed=0, **motion):
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
    return [examined(flight_of_errors(rng.standard_normal((2000, AXES)), seed)) for seed in range(100)]


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
    found = examined(flight_of_errors(errors), lags=12)
    for axis in range(AXES):
        expected = autocorrelation_by_hand(errors[:, axis], 12)
        np.testing.assert_allclose(found.autocorrelation[:, axis], expected, rtol=1e-12, atol=1e-14)
        statistic = 300 * 302 * np.sum(expected**2 / (300 - np.arange(1, 13)))
        assert found.ljung_box[axis] == pytest.approx(chi2.sf(statistic, 12), rel=1e-9)
    np.testing.assert_allclose(found.lag, 0.01 * np.arange(1, 13))
    assert found.band == pytest.approx(1.96 / np.sqrt(300))


def test_nothing_is_correlated_across_the_pause_between_flights():
    """The second flight is the first again: across the pause the correlation at its length would be one."""
    errors = np.random.default_rng(45).standard_normal((60, AXES))
    found = examined(joined([flight_of_errors(errors), flight_of_errors(errors)]), lags=10)
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
    found = examined(flight_of_errors(errors, rate=rate), lags=10)
    own = found.correlation[found.input.index("pitch rate"), :, 2]
    assert found.input_lag[np.argmax(np.abs(own))] == pytest.approx(0.01 * delay)
    assert np.min(own) < -0.98
    assert np.max(np.abs(found.correlation[found.input.index("pitch rate"), :, :2])) < 0.12


def test_correlation_without_delay_is_pearson_s():
    errors = np.random.default_rng(49).standard_normal((200, AXES))
    data = flight_of_errors(errors)
    found = examined(data, lags=3)
    expected = np.corrcoef(data.motion.acceleration[:, 0], errors[:, 1])[0, 1]
    assert found.correlation[found.input.index("roll acceleration"), 3, 1] == pytest.approx(expected, rel=1e-12)
    assert found.correlation.shape == (len(found.input), 7, AXES)


def test_nothing_follows_an_input_that_stays_what_it_is():
    rate = np.random.default_rng(50).standard_normal((200, AXES))
    rate[:, 2] = 0.7 + 1e-14 * rate[:, 0]
    found = examined(flight_of_errors(np.random.default_rng(54).standard_normal((200, AXES)), rate=rate), lags=3)
    constant = np.isnan(found.correlation).all(axis=(1, 2))
    still = {name for name, own in zip(found.input, constant, strict=True) if own}
    assert still == {"yaw rate", *(f"predicted {axis} torque" for axis in ("roll", "pitch", "yaw"))}


def test_rounding_is_not_called_coloured():
    torque = np.random.default_rng(51).standard_normal((500, AXES)) * [5.0, 1.0, 0.1]
    data = flight_of_errors(torque)
    slow = 1e-12 * np.sin(0.01 * np.arange(500))[:, None] * [1.0, 1.0, 0.0]
    found = examine_residuals("x", data, lambda _: torque + slow + [0.0, 0.0, 1.0] * torque, 20)
    np.testing.assert_array_equal(found.exact, [True, True, False])
    assert np.isnan(found.ljung_box[:2]).all()
    assert np.isfinite(found.ljung_box[2])
    assert np.isnan(found.autocorrelation[:, :2]).all()
    assert np.isnan(found.correlation[:, :, :2]).all()


def test_no_torque_and_no_error_at_all():
    found = examined(flight_of_errors(np.zeros((50, AXES))))
    assert found.exact.all()
    np.testing.assert_array_equal(found.histogram_count.sum(axis=0), 50)


def test_histogram_and_quantiles():
    errors = np.random.default_rng(52).standard_normal((4000, AXES)) * [1.0, 2.0, 0.5]
    found = examined(flight_of_errors(errors))
    np.testing.assert_array_equal(found.histogram_count.sum(axis=0), 4000)
    np.testing.assert_allclose(found.histogram_edge[-1], np.abs(errors).max(axis=0))
    np.testing.assert_allclose(found.histogram_edge, -found.histogram_edge[::-1], atol=1e-12)
    slope = [np.polyfit(found.normal_quantile, own, 1)[0] for own in found.quantile.T]
    np.testing.assert_allclose(slope, [1.0, 2.0, 0.5], rtol=0.05)


@pytest.mark.parametrize("missing", [0.02, 0.1])
def test_white_noise_stays_white_where_samples_are_missing(missing):
    """With the mean of every stretch taken out, two in three p-values were below 0.01 at 2 % missing."""
    chances, outside = [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        data = flight_of_errors(rng.standard_normal((2000, AXES)))
        found = examined(data[np.flatnonzero(rng.random(2000) > missing)], lags=30)
        chances.append(found.ljung_box)
        outside.append(np.abs(found.autocorrelation) > found.band)
    assert kstest(np.ravel(chances), "uniform").pvalue > 1e-3
    assert 0.025 < np.mean(outside) < 0.06


def test_pairs_across_a_missing_sample_by_hand():
    errors = np.random.default_rng(60).standard_normal((40, AXES))
    kept = np.delete(np.arange(40), [5, 6, 21])
    found = examined(flight_of_errors(errors)[kept], lags=4)
    own = errors[kept, 1] - errors[kept, 1].mean()
    value = dict(zip(kept, own, strict=True))
    for lag in range(1, 5):
        expected = sum(value[t] * value[t + lag] for t in kept if t + lag in value) / (own @ own)
        assert found.autocorrelation[lag - 1, 1] == pytest.approx(expected, rel=1e-12)


def test_a_bias_shows_in_the_mean_alone():
    noise = 0.1 * np.random.default_rng(61).standard_normal((3000, AXES))
    biased = noise + np.array([1.0, 0.0, 0.0])
    found = examined(flight_of_errors(biased))
    np.testing.assert_allclose(found.mean, biased.mean(axis=0))
    assert np.all(found.ljung_box > 0.01)
    assert found.mean_p[0] < 1e-12
    assert np.all(found.mean_p[1:] > 0.01)
    assert examined(flight_of_errors(np.full((100, AXES), 0.5))).mean_p.max() < 1e-12


def test_errors_that_remember_do_not_look_biased():
    """Student's test of single samples would call four in ten biased at 1 %."""
    chances = []
    for seed in range(200):
        drawn = np.random.default_rng(seed).standard_normal((3200, AXES))
        coloured = signal.lfilter([1.0], [1.0, -np.exp(-0.1)], drawn, axis=0)[200:]
        chances.append(examined(flight_of_errors(coloured), lags=1).mean_p)
    assert np.mean(np.array(chances) < 0.01) < 0.03


def test_a_mean_of_rounding_or_of_three_samples_is_not_tested():
    data = flight_of_errors(np.random.default_rng(62).standard_normal((500, AXES)))
    assert np.isnan(examine_residuals("x", data, lambda _: data.torque - 1e-12, 5).mean_p).all()
    assert np.isnan(examined(data[:3], lags=1).mean_p).all()


def test_a_perfect_model_with_noise_follows_nothing():
    """The measured torque holds the error: correlated with it, a perfect model would not look perfect."""
    torque, noise = np.random.default_rng(63).standard_normal((2, 3000, AXES)) * [[[1.0]], [[0.2]]]
    data = replace(flight_of_errors(noise), torque=torque + noise)
    found = examine_residuals("x", data, lambda _: torque, 10)
    own = found.correlation[found.input.index("predicted roll torque"), 10, 0]
    assert own == pytest.approx(np.corrcoef(torque[:, 0], noise[:, 0])[0, 1], rel=1e-9)
    assert abs(own) < 2 * found.band < np.corrcoef(data.torque[:, 0], noise[:, 0])[0, 1]


def test_how_many_of_how_many_were_examined(monkeypatch):
    monkeypatch.setattr(residuals, "_MOST_SAMPLES", 120)
    found = examined(flight_of_errors(np.random.default_rng(64).standard_normal((200, AXES))), lags=5)
    assert (found.samples, found.available) == (120, 200)
