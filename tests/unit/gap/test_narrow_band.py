"""Background under a spectrum, and a search for a line where there is nothing to search."""

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.gap.residual.narrow_band import LOWEST, background, grid, narrow_band, noise_like, pooled_power

LENGTHS = [2000, 1500]


def red(rng, amplitude=0.0):
    time = 0.2 * np.arange(2000)
    noise = lfilter([1], [1, -0.8], rng.standard_normal((2, 1, 2000)), axis=2)
    line = amplitude * np.sin(2 * np.pi * time)
    return [(own + line)[:, :length] for own, length in zip(noise, LENGTHS, strict=True)]


def test_the_background_is_that_of_the_process_and_does_not_see_a_line():
    on = grid(LENGTHS, 0.2)
    series = red(np.random.default_rng(0), amplitude=3.0)
    smooth = background(pooled_power(series, on), on)[0]
    # Two flights: half the sum of two squared amplitudes, each exponential, has its median at 0.839.
    exact = 2 * 0.839 / np.abs(1 - 0.8 * np.exp(-2j * np.pi * on.frequency * 0.2)) ** 2
    away = np.log(smooth / exact)[LOWEST:]
    assert abs(away.mean()) < 0.1
    assert np.sqrt(np.mean(away**2)) < 0.35
    # The power of the line itself is a thousand times the background.
    line = np.argmin(np.abs(on.frequency - 1.0)) - LOWEST
    assert np.abs(away[line - 20 : line + 20]).max() < 0.5


def test_drawn_noise_has_the_background_it_was_drawn_from():
    on = grid(LENGTHS, 0.2)
    rng = np.random.default_rng(1)
    smooth = 1 / np.abs(1 - 0.8 * np.exp(-2j * np.pi * on.frequency * 0.2))[None] ** 2
    present = np.ones((2, 1), dtype=bool)
    drawn = np.mean([noise_like(smooth, LENGTHS, present, on, rng) for _ in range(200)], axis=0)
    ratio = (drawn / (2 * smooth))[0, LOWEST:]
    assert ratio.mean() == pytest.approx(1, abs=0.05)


def test_nothing_to_search_finds_nothing():
    rng = np.random.default_rng(2)
    assert narrow_band([np.zeros((100, 6))], [np.zeros((100, 3))], 0.2, 9, rng) is None
    assert narrow_band([np.ones((20, 6))], [np.zeros((20, 3))], 0.2, 9, rng) is None


def test_a_force_has_no_energy_of_rotation():
    rng = np.random.default_rng(3)
    residual = np.zeros((300, 6))
    residual[:, 5] = np.sin(2 * np.pi * 0.7 * 0.2 * np.arange(300)) + 0.3 * rng.standard_normal(300)
    band = narrow_band([residual, np.zeros((300, 6))], [rng.standard_normal((300, 3))] * 2, 0.2, 19, rng)
    assert (band.channel, band.energy, band.p_value) == ("force z", "neither", 0.05)


@pytest.mark.parametrize(("amplitude", "all_drawn"), [(0.0, False), (3.0, True)])
def test_no_noise_is_drawn_for_what_is_not_significant_any_more(amplitude, all_drawn, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "cpfls_cli.gap.residual.narrow_band.noise_like", lambda *given: drawn.append(None) or noise_like(*given)
    )
    residual = [
        np.column_stack([own[0], *np.zeros((5, own.shape[1]))]) for own in red(np.random.default_rng(4), amplitude)
    ]
    rates = [np.zeros((len(own), 3)) for own in residual]
    whole = narrow_band(residual, rates, 0.2, 99, np.random.default_rng(5))
    assert len(drawn) == 99
    early = narrow_band(residual, rates, 0.2, 99, np.random.default_rng(5), significance=0.05)
    assert (len(drawn) == 198) is all_drawn
    assert (early.p_value <= 0.05) is (whole.p_value <= 0.05) is all_drawn
