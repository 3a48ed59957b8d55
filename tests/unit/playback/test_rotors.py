"""What acts at the samples next to what acts over the steps between them."""

import numpy as np
import pytest

from cpfls_cli.playback.rotors import RotorResponse, rotor_terms_by_step

PERIOD, FINER = 0.01, 50
RESPONSE = RotorResponse(delay_s=0.014, lag_s=0.03, slow_s=0.2)


def speeds(period, duration=2.0):
    time = np.arange(round(duration / period) + 1) * period
    return np.stack([900 + 150 * np.sin(9 * time), 1000 - 200 * np.cos(14 * time)], axis=1)


@pytest.mark.parametrize("response", [RotorResponse(), RESPONSE])
def test_at_a_sample_the_terms_are_those_of_a_short_step_there(response):
    """Steps a fiftieth as long begin at the sample; half of one is between their mean and it."""
    coarse = response.terms_at_samples(speeds(PERIOD), PERIOD, "linear")
    fine = rotor_terms_by_step(
        speeds(PERIOD / FINER), PERIOD / FINER, "linear", response.delay_s, response.lag_s, response.slow_s
    )[::FINER]
    # Slow actuation forgets in which step it began.
    late = slice(150, -2)
    size = np.abs(fine[late]).max(axis=0)
    assert (np.abs(coarse[late] - fine[late]).max(axis=0) < 0.02 * size).all()
    assert (np.abs(coarse[late, 1:5] - fine[late, 1:5]).max(axis=0) < 2e-3 * size[1:5]).all()


def test_speeds_that_stay_until_the_next_sample_jump_at_it():
    terms = RotorResponse().terms_at_samples(np.array([[100.0], [100.0], [140.0], [140.0]]), PERIOD, "previous")
    assert terms[:, 1].tolist() == [100.0, 100.0, 120.0, 140.0]
    assert terms[:, 2].tolist() == [1e4, 1e4, 120.0**2, 140.0**2]


def test_behind_a_lag_nothing_jumps():
    step = np.where(np.arange(60) < 20, 100.0, 140.0)[:, None]
    found = RotorResponse(lag_s=0.05).terms_at_samples(step, PERIOD, "previous")[:, 1]
    since = np.maximum(np.arange(60) - 20, 0) * PERIOD
    assert found == pytest.approx(140 - 40 * np.exp(-since / 0.05), abs=1e-9)
