"""Spectra of windows against signals whose derivatives are known."""

import numpy as np
import pytest

from cpfls_cli.estimation.spectra import block_spectra, cut_blocks, eroded, transforms, window_starts, without_slow


def test_derivatives_by_parts_are_those_of_the_signal():
    period, length = 0.002, 500
    time = np.arange(2000) * period
    signal, slope, bend = (
        np.real((2j * np.pi * 3.1) ** order * np.exp(2j * np.pi * 3.1 * time + 0.4j)) for order in range(3)
    )
    begins = window_starts(np.ones(2000, dtype=bool), length)
    found = transforms(signal, begins, length, period, 2)
    for each, actual in zip(found, (signal, slope, bend), strict=True):
        wanted = transforms(actual, begins, length, period)[0]
        np.testing.assert_allclose(each[:, :10], wanted[:, :10], atol=2e-4 * np.abs(wanted).max())


def test_windows_lie_in_what_is_usable():
    usable = np.ones(100, dtype=bool)
    usable[[30, 31]] = False
    begins = window_starts(usable, 20)
    assert begins.tolist() == [0, 10, 32, 42, 52, 62, 72]
    assert np.flatnonzero(~eroded(usable, 3))[[3, -4]].tolist() == [27, 34]


def test_a_burst_is_cut_finer_than_rest():
    power = np.full(60, 0.1)
    power[20:30] = 10.0
    block = cut_blocks(power)
    assert (np.diff(block) >= 0).all()
    assert len(np.unique(block[20:30])) >= 3
    assert np.bincount(block).min() >= 3


def test_slow_motion_is_taken_off_and_a_gap_does_not_spread():
    time = np.arange(4000) / 500
    slow, fast = np.sin(2 * np.pi * 0.1 * time), np.sin(2 * np.pi * 5 * time)
    found = without_slow(slow + fast, np.ones(4000, dtype=bool), 150)
    assert np.abs(found - fast)[500:-500].max() < 0.15


def test_a_gain_by_an_instrument_is_that_of_the_vehicle():
    rng = np.random.default_rng(1)
    z, disturbance = rng.standard_normal((2, 300, 9)) + 1j * rng.standard_normal((2, 300, 9))
    u = z - 0.9 * disturbance
    spectra = block_spectra(
        [z, u, 2.0 * u + disturbance], np.repeat(np.arange(10), 30), np.arange(9.0), np.arange(9) > 0
    )
    assert np.abs(spectra.gain(0, 1, 2) - 2.0).max() < 0.3 < np.abs(spectra.gain(1, 1, 2) - 2.0).min()
    assert spectra.coherence(0, 1) == pytest.approx(np.full(8, 1 / 1.81), abs=0.15)
    assert spectra.windows.sum() == 300
