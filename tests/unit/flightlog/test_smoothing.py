import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.flightlog.smoothing import derivative, low_pass

TIME = np.arange(4000) / 200


def test_the_filter_has_no_phase():
    """A symmetric pulse stays symmetric about its own centre."""
    filtered = low_pass(np.exp(-(((TIME - TIME[2000]) / 0.05) ** 2))[:, None], 200, 4.0, 4)[:, 0]
    assert np.argmax(filtered) == 2000
    np.testing.assert_allclose(filtered[1000:2000], filtered[3000:2000:-1], atol=1e-6)
    assert filtered.max() < 0.9


@pytest.mark.parametrize(("frequency", "gain"), [(0.5, 1.0), (8.0, 0.5), (40.0, 0.0)])
def test_the_cut_off_halves_the_amplitude(frequency, gain):
    tone = np.sin(2 * np.pi * frequency * TIME)
    filtered = low_pass(tone[:, None], 200, 8.0, 4)[:, 0]
    middle = slice(1000, 3000)
    assert 2 * np.mean(filtered[middle] * tone[middle]) == pytest.approx(gain, abs=0.002)


def test_no_cut_off_leaves_the_values():
    values = np.random.default_rng(0).standard_normal((50, 3))
    np.testing.assert_array_equal(low_pass(values, 100, None, 4), values)


def test_a_cut_off_above_half_the_rate_is_refused():
    with pytest.raises(SettingError, match=r"is not below half of the log's rate, 50 Hz") as caught:
        low_pass(np.zeros((50, 3)), 100, 60.0, 4)
    assert caught.value.key == "lowpass_hz"


def test_the_derivative_is_of_fourth_order():
    """The stated relative error at 8 Hz sampled with 200 Hz: (2 pi 8 / 200)^4 / 180 = 2.2e-5."""
    angular = 2 * np.pi * 8
    slope = derivative(TIME, np.sin(angular * TIME)[:, None])[100:-100, 0]
    error = np.abs(slope - angular * np.cos(angular * TIME[100:-100])).max() / angular
    assert error == pytest.approx(2.2e-5, rel=0.1)
