"""Frequency responses of a plant that is known by formula, flown in a loop with disturbances and noise inside."""

import numpy as np
import pytest
from scipy.signal import csd, lfilter

from cpfls_cli.response.spectra import Channel, Stretch, frequency_response

STEP_S, EVERY, SECONDS, DRAWS = 1e-3, 5, 100.0, 12
PERIOD = STEP_S * EVERY
INERTIA, LAG_S = 4e-5, 0.03
GUST, MEMORY_S, NOISE = 5.0, 0.5, 0.01
SEEN = (1.0, 8.0)
"""Hz, that the setpoint excites above gusts and noise."""


def plant(frequency):
    """Command to angular acceleration as integrated here: a lag and a body, both by Euler's rule."""
    z = np.exp(2j * np.pi * frequency * STEP_S)
    lag = STEP_S / LAG_S / (z - 1 + STEP_S / LAG_S)
    return 2j * np.pi * frequency * STEP_S / (z - 1) * lag / INERTIA


@pytest.fixture(scope="module")
def flown():
    """Commands, measured rates and the one setpoint of flights with a gust each; shapes (time, draw) and (time,)."""
    rng, samples = np.random.default_rng(1), round(SECONDS / STEP_S)
    keep = np.exp(-STEP_S / MEMORY_S)
    gusts = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal((samples, DRAWS)), axis=0) * GUST
    noise = NOISE * rng.standard_normal((samples, DRAWS))
    tones = np.linspace(0.15, 9.0, 60)
    phases = 2 * np.pi * (tones * (STEP_S * np.arange(samples))[:, None] + rng.uniform(0, 1, 60))
    setpoint = (0.05 / np.sqrt(tones) * np.sin(phases)).sum(axis=1)
    angle, rate, torque = (np.zeros(DRAWS) for _ in range(3))
    commands, rates = [], []
    for now in range(samples):
        measured = rate + noise[now]
        command = INERTIA * (10**2 * (setpoint[now] - angle) - 1.5 * 10 * measured)
        if now % EVERY == 0:
            commands.append(command)
            rates.append(measured)
        angle, rate, torque = (
            angle + STEP_S * rate,
            rate + STEP_S * (torque / INERTIA + gusts[now]),
            torque + STEP_S / LAG_S * (command - torque),
        )
    return np.array(commands), np.array(rates), setpoint[::EVERY]


def estimate(flown, draws, instrument=None):
    commands, rates, _ = flown
    stretches = [Stretch(commands[:, d], Channel(integral=rates[:, d]), None, instrument) for d in draws]
    return frequency_response(stretches, PERIOD)


def ratios(found, band=SEEN):
    part = (found.frequency >= band[0]) & (found.frequency <= band[1])
    return (found.gain / plant(found.frequency))[part], found.random_error[part]


def mean(ratio, error):
    return np.sum(ratio / error**2) / np.sum(1 / error**2)


def test_without_an_instrument_it_is_the_loop(flown):
    """Slow gusts are answered: the response seems weak; noise of the gyroscope is answered: it seems strong."""
    found = estimate(flown, range(3))
    assert np.abs(ratios(found, (0.3, 0.6))[0]).max() < 0.5
    assert np.abs(ratios(found, (9.5, 15.0))[0]).min() > 3.0
    assert found.coherence[(found.frequency > 9.5) & (found.frequency < 12)].min() > 0.6


def test_an_instrument_gives_the_plant(flown):
    found = estimate(flown, range(3), flown[2][:, None])
    ratio, error = ratios(found)
    assert np.abs(ratio - 1).max() < 0.12
    assert np.abs(mean(ratio, error) - 1) < 0.01
    assert error.max() < 0.06
    assert found.coherence[(found.frequency > 10.5) & (found.frequency < 30)].max() < 0.3


def test_the_random_error_is_that_of_repeated_flights(flown):
    """Root mean square of errors in random errors, magnitude and phase, over draws and frequencies."""
    apart = []
    for draw in range(DRAWS):
        ratio, error = ratios(estimate(flown, [draw], flown[2][:, None]))
        apart += [(np.abs(ratio) - 1) / error, np.angle(ratio) / error]
    assert 0.75 < np.sqrt(np.mean(np.square(apart))) < 1.25


def test_many_instruments_mislead_no_more_than_one(flown):
    """Forty lags of a setpoint, most of them of no use."""
    lags = np.stack([np.roll(flown[2], lag) for lag in range(-100, 100, 5)], axis=1)
    ratio, error = ratios(estimate(flown, range(3), lags))
    assert np.abs(mean(ratio, error) - 1) < 0.01
    noise = np.random.default_rng(2).standard_normal((len(flown[2]), 40))
    assert np.nanmedian(estimate(flown, range(3), noise).coherence) < 0.02


@pytest.mark.parametrize("columns", [1, 2])
def test_repeats_are_instruments_for_each_other(flown, columns):
    """Each flight's instruments are means of the others: found in the same windows they would hold the gusts again."""
    commands, rates, _ = (each[:, :4] if each.ndim > 1 else each for each in flown)
    stretches = []
    for one in range(4):
        others = [each.sum(axis=1) - each[:, one] for each in (commands / INERTIA, rates)][:columns]
        stretches.append(Stretch(commands[:, one], Channel(integral=rates[:, one]), None, np.stack(others, axis=1)))
    ratio, error = ratios(frequency_response(stretches, PERIOD))
    assert np.abs(ratio - 1).max() < 0.12
    assert np.abs(mean(ratio, error) - 1) < 0.01
    unlike = np.random.default_rng(3).standard_normal((4, len(rates), 6))
    blind = [each._replace(instrument=unlike.sum(axis=0) - own) for each, own in zip(stretches, unlike, strict=True)]
    assert np.nanmedian(frequency_response(blind, PERIOD).coherence) < 0.02


def test_windows_of_one_length_are_those_of_scipy():
    """Five seconds hold windows of one second alone; the derivative is taken by parts, not by a product with jw."""
    rng, period, length = np.random.default_rng(4), 0.01, 101
    command = lfilter([0.3], [1, -0.7], rng.standard_normal(5 * length))
    rate = lfilter([period], [1, -0.98], command) + 1e-3 * rng.standard_normal(len(command))
    found = frequency_response([Stretch(command, Channel(rate))], period)
    by_parts = frequency_response([Stretch(command, Channel(integral=rate))], period)
    settings = {"window": np.hanning(length), "noverlap": length - 25, "nfft": 1 << 15, "detrend": "linear"}
    at, cross = csd(command, rate, 1 / period, **settings)
    _, power = csd(command, command, 1 / period, **settings)
    theirs = np.interp(found.frequency, at, cross / power)
    assert np.abs(found.gain / theirs - 1)[found.frequency > 3.0].max() < 0.02
    waves = 2j * np.pi * found.frequency
    assert np.abs(by_parts.gain / (waves * found.gain) - 1)[found.frequency > 5].max() < 0.2


def test_a_derivative_by_parts_is_that_of_the_formula():
    """Where rates are large and slow, a window times jw mistakes its own edges for acceleration."""
    rng, period = np.random.default_rng(5), 0.01
    pushes = lfilter([0.2], [1, -0.8], rng.standard_normal(6000))
    # Between samples the acceleration is a straight line, and so is its integral known exactly.
    rate = period * np.concatenate([[0.0], np.cumsum(0.5 * (pushes[1:] + pushes[:-1]))])
    found = frequency_response([Stretch(pushes, Channel(integral=rate))], period)
    low = found.frequency < 2.0
    assert np.abs(found.gain - 1)[low].max() < 2e-3
    assert found.random_error[low].max() < 2e-3


def test_unknown_parts_of_an_instrument_are_cut_out(flown):
    holes = flown[2][:, None].copy()
    holes[9000:9400] = np.nan
    ratio, error = ratios(estimate(flown, range(3), holes))
    assert np.abs(mean(ratio, error) - 1) < 0.01


def test_what_is_too_short_shows_nothing():
    short = Stretch(np.ones(50), Channel(np.ones(50)))
    assert frequency_response([short], 0.01) is None
    assert frequency_response([short._replace(instrument=np.full((50, 1), np.nan))], 0.01) is None
