"""The estimated floor against the scatter of windows that see the same noise without any motion."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import nnls
from scipy.signal import butter, filtfilt, lfilter

from cpfls_cli.effects.effect import Columns
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.noise_floor import channel_cut_offs, known_up_to, noise_floor
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import windows

PERIOD, SAMPLES = 0.01, 6000
THROUGH = windows(PERIOD, 0.4, 0.5)
TIME = PERIOD * np.arange(SAMPLES)
GYRO, ROTOR, RHO = 0.01, 0.4, 0.7


def coloured(rho, seed, samples=SAMPLES):
    """Noise of variance 1 that is correlated by rho from sample to sample."""
    white = np.random.default_rng(seed).standard_normal((samples + 200, 6))
    return np.sqrt(1 - rho**2) * lfilter([1.0], [1.0, -rho], white, axis=0)[200:]


def noise(kind, seed, samples=SAMPLES):
    gyro = GYRO * coloured(RHO if "gyro AR" in kind else 0.0, seed, samples)
    rotor = ROTOR * coloured(RHO if "rotor AR" in kind else 0.0, seed + 1000, samples)
    return Columns(rotor * ("rotor" in kind), gyro * ("gyro" in kind))


@cache
def scatter(kind):
    long = noise(kind, 99, 20 * SAMPLES)
    return (THROUGH.average(long.direct) + THROUGH.derivative(long.momentum)).std(axis=0)


def add(left, right):
    return Columns(left.direct + right.direct, left.momentum + right.momentum)


def slow_motion():
    """What a model leaves of a missing effect: larger than the noise of a window, and slower than windows."""
    turn = 2 * np.pi * np.linspace(0.3, 0.6, 6)
    return Columns(0.3 * np.sin(TIME[:, None] * turn), np.zeros((SAMPLES, 6)))


def bursts():
    """A tenth of the flight with fast shaking ten times as large as the noise."""
    shaking = np.sin(2 * np.pi * 17.0 * TIME) * (np.sin(2 * np.pi * TIME / 20.0) > 0.951)
    return Columns(np.tile(10 * ROTOR * shaking[:, None], 6), np.zeros((SAMPLES, 6)))


KINDS = ["gyro", "rotor", "gyro rotor", "gyro AR", "rotor AR", "gyro AR rotor"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("motion", [None, slow_motion, bursts], ids=["still", "slow motion", "bursts"])
def test_floor_is_the_scatter_of_windows(kind, motion):
    ratio = []
    for seed in range(3):
        given = noise(kind, seed) if motion is None else add(noise(kind, seed), motion())
        ratio.extend(noise_floor(given, THROUGH) / scatter(kind))
    # What slow noise has below the lowest frequency that is looked at cannot be sure: rather too much than too little.
    assert np.median(ratio) == pytest.approx(1, abs=0.3)
    assert np.mean(np.abs(np.array(ratio) - 1) < 0.3) > (0.5 if "AR" in kind else 0.75)
    assert min(ratio) > 0.7
    assert max(ratio) < (2.5 if "AR" in kind else 1.6)


def test_floor_of_short_flights_is_right_in_the_mean():
    found = [noise_floor(noise("gyro rotor", seed, 500), THROUGH) for seed in range(10)]
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(found))), scatter("gyro rotor").mean(), rtol=0.2)


def test_floor_scales_with_the_noise_and_nothing_has_no_floor():
    given = noise("gyro rotor", 5)
    tripled = Columns(3 * given.direct, 3 * given.momentum)
    np.testing.assert_allclose(noise_floor(tripled, THROUGH), 3 * noise_floor(given, THROUGH))
    assert not noise_floor(Columns(np.zeros((900, 6))), THROUGH).any()


def test_shifted_windows_hear_one_frequency_and_keep_integration_by_parts():
    tone = np.exp(2j * np.pi * 12.0 * TIME)
    heard = THROUGH.modulated(12.0)
    np.testing.assert_allclose(np.abs(heard.average(tone)), 1.0)
    assert np.abs(THROUGH.modulated(20.0).average(tone)).max() < 0.01
    np.testing.assert_allclose(heard.derivative(tone), 2j * np.pi * 12.0 * heard.average(tone), rtol=2e-3)


@pytest.mark.parametrize("cut_off", [8.0, 12.0, 18.0, 30.0])
@pytest.mark.parametrize("kind", ["gyro", "rotor", "gyro rotor"])
def test_floor_of_a_low_passed_log_is_that_of_the_raw_one(kind, cut_off):
    ratio, naive = [], []
    through = butter(4, 2 * PERIOD * cut_off)
    for seed in range(3):
        given = noise(kind, seed)
        left = Columns(filtfilt(*through, given.direct, axis=0), filtfilt(*through, given.momentum, axis=0))
        ratio.extend(noise_floor(left, THROUGH, np.full(6, cut_off)) / scatter(kind))
        naive.extend(noise_floor(left, THROUGH) / scatter(kind))
    assert np.median(ratio) == pytest.approx(1, abs=0.3)
    assert 0.5 < min(ratio) < max(ratio) < 2.5
    assert cut_off > 20 or np.median(naive) < 0.3


def test_only_the_channels_that_were_filtered_are_looked_at_below_the_cut_off():
    given = noise("gyro rotor", 7)
    edges = np.array([12.0, 12.0, 12.0, np.inf, np.inf, np.inf])
    np.testing.assert_allclose(noise_floor(given, THROUGH, edges)[3:], noise_floor(given, THROUGH)[3:])


def test_cut_offs_are_those_of_the_signals_that_a_channel_is_made_of():
    rng = np.random.default_rng(3)
    white = {name: rng.standard_normal((SAMPLES, 3)) for name in ("attitude", "body_rate", "velocity", "acceleration")}
    filtered = {name: filtfilt(*butter(4, 0.24), white[name], axis=0) for name in ("attitude", "body_rate", "velocity")}
    speed = 300 + rng.standard_normal((SAMPLES, 4))
    signals = Signals(time=TIME, vehicle=VehicleSettings(), rotor_speed=speed, **(white | filtered))
    assert known_up_to(signals).keys() == filtered.keys()
    np.testing.assert_allclose(channel_cut_offs(signals, euler=False), 12.0, rtol=0.1)
    sensed = replace(signals, specific_force=white["acceleration"])
    np.testing.assert_allclose(channel_cut_offs(sensed, euler=False), [12.0] * 3 + [np.inf] * 3, rtol=0.1)


@pytest.mark.parametrize("seed", range(30))
def test_the_pair_of_spectra_leaves_as_little_as_scipy_finds(seed):
    """Of six flat and six rising spectra one each, neither negative; the first two unless others are far better."""
    from cpfls_cli.gap.balance.noise_floor import _best_pair

    rng = np.random.default_rng(seed)
    spectra = np.cumsum(rng.random((16, 12)) ** 4, axis=0)[:: rng.choice([-1, 1])]
    power = spectra[:, rng.integers(12, size=2)] @ rng.random(2) * np.exp(0.1 * rng.standard_normal(16))
    relative = 10.0 ** rng.uniform(-30, 30) * spectra / power[:, None]
    left = np.array([nnls(relative[:, [2 * i, 2 * j + 1]], np.ones(16))[1] ** 2 for i in range(6) for j in range(6)])
    chosen = _best_pair(relative)
    assert (chosen == 0) == (left[0] <= 1.5 * left.min())
    # Where one spectrum alone is best, whatever stands next to it leaves the same.
    assert chosen == 0 or left[chosen] == pytest.approx(left.min(), rel=1e-9)
