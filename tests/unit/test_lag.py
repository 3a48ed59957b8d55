"""Delay and lag against exact answers, in all three ideas of what is between samples."""

import numpy as np
import pytest

from cpfls_cli.lag import best_delay, delayed, fit_delay, lagged

BETWEEN = pytest.mark.parametrize("between", ["cubic", "linear", "previous"])


@pytest.fixture
def noise():
    return np.random.default_rng(5).standard_normal((80, 2)) + 5.0


def test_lag_is_the_solution_of_its_equation():
    time, turn, tau = np.arange(0, 4, 0.01), 2 * np.pi * 3.0, 0.03
    lag = turn * tau
    settled = (np.sin(turn * time) - lag * np.cos(turn * time)) / (1 + lag**2)
    expected = settled - settled[0] * np.exp(-time / tau)
    # Straight lines between samples would be off by 0.002.
    np.testing.assert_allclose(lagged(np.sin(turn * time), tau / 0.01).start, expected, atol=1e-4)


def test_delay_does_not_weaken_a_fast_signal():
    time, turn = np.arange(0, 4, 0.01), 2 * np.pi * 3.0
    found = delayed(np.sin(turn * time), 1.5)
    np.testing.assert_allclose(found[5:-5], np.sin(turn * (time - 0.015))[5:-5], atol=1e-4)


@BETWEEN
@pytest.mark.parametrize("ratio", [0.0, 0.01, 0.3, 1.0, 3.0, 300.0])
def test_lag_leaves_a_constant_alone(ratio, between):
    np.testing.assert_allclose(lagged(np.full((50, 4), 348.0), ratio, between), np.full((3, 50, 4), 348.0), rtol=1e-12)


@pytest.mark.parametrize("delay", [0.02, 0.0025, -0.02, -0.0212, 0.6, -0.6])
def test_delay_shifts_a_line_exactly_and_holds_its_ends(delay):
    time = np.arange(100) * 0.005
    expected = np.clip(3.0 * (time - delay), 0.0, 3.0 * time[-1])
    np.testing.assert_allclose(delayed(3.0 * time, delay / 0.005), expected, atol=1e-12)


@BETWEEN
@pytest.mark.parametrize("ratio", [0.05, 0.7, 1.0, 1.3, 40.0])
def test_lag_agrees_with_one_integrated_in_fine_steps(noise, between, ratio):
    fine = 2000
    place = np.arange(fine) / fine
    inner = noise[1:-2]
    if between == "cubic":
        taps = [-place * (place - 1) * (place - 2) / 6, (place**2 - 1) * (place - 2) / 2]
        taps += [-place * (place + 1) * (place - 2) / 2, place * (place**2 - 1) / 6]
    else:
        taps = [0 * place, 1 - place, place, 0 * place] if between == "linear" else [0, 1 + 0 * place, 0, 0]
    curve = sum(np.multiply.outer(tap, noise[k : k + len(inner)]) for k, tap in enumerate(taps) if np.any(tap))
    found, value = lagged(noise, ratio, between), lagged(noise, ratio, between).start[1]
    keep = np.exp(-1 / (fine * ratio))
    for step in range(12):
        along = [value]
        for wanted in curve[:, step]:
            along.append(wanted + keep * (along[-1] - wanted))
        value = along[-1]
        assert found.end[1 + step] == pytest.approx(value, abs=2e-3)
        assert found.mean[1 + step] == pytest.approx(np.mean(along, axis=0), abs=2e-3)


@pytest.mark.parametrize("between", ["linear", "previous"])
def test_a_held_command_moved_by_part_of_a_sample_is_the_mix_of_two(noise, between):
    np.testing.assert_allclose(delayed(noise, 1.3, between)[2:], 0.7 * noise[1:-1] + 0.3 * noise[:-2], rtol=1e-12)


@BETWEEN
@pytest.mark.parametrize("ratio", [0.0, 0.3, 3.0])
def test_a_complex_step_carries_the_derivative(noise, between, ratio):
    step, wide = 1e-20, 1e-6
    for by_step, ahead, behind in (
        (lagged(noise, ratio + 1j * step, between).mean, *(lagged(noise, ratio + d, between).mean for d in (wide, 0))),
        (delayed(noise, 1.3 + 1j * step, between), *(delayed(noise, 1.3 + d, between) for d in (wide, 0))),
    ):
        np.testing.assert_allclose(by_step.imag / step, (ahead - behind) / wide, atol=1e-4)


def test_the_best_delay_lies_between_those_that_were_tried():
    delays = np.linspace(-0.1, 0.1, 9)
    misfit = (delays[:, None] - [0.013, -0.041, 0.2, -0.3]) ** 2
    best, inside = best_delay(delays, misfit)
    np.testing.assert_allclose(best, [0.013, -0.041, 0.1, -0.1], atol=1e-12)
    assert inside.tolist() == [True, True, False, False]


@pytest.fixture
def followed():
    """What each of two axes makes of two signals, 2.3 and 4.6 samples later, with noise of its own."""
    rng = np.random.default_rng(6)
    drives = np.array([np.convolve(column, np.hanning(16), "same") for column in rng.standard_normal((2, 2400))]).T
    signal = np.stack([delayed(drives, each) @ weights for each, weights in ((2.3, [2, -1]), (4.6, [1, 3]))], axis=1)
    return drives, signal + [0.3, 1.5] * rng.standard_normal(signal.shape) + 7.0


def tried(drives, signal, block, **how):
    def moved(delay):
        return np.broadcast_to(delayed(drives, delay)[:, None], (*signal.shape, 2)), signal

    return fit_delay(np.arange(-2.0, 12.0), moved, block, **how)


def test_each_axis_has_its_delay_and_its_coefficients(followed):
    found = tried(*followed, np.arange(2400) // 200, each=True)
    assert (np.abs(found.delay - [2.3, 4.6]) < 2 * found.half).all()
    assert (found.half < [0.1, 0.3]).all()
    np.testing.assert_allclose(found.coefficients[0], [[2, -1], [1, 3]], atol=0.25)
    assert found.inside.all()


def test_a_delay_at_the_end_is_no_surer_than_a_step(followed):
    drives, signal = followed
    found = tried(drives, delayed(signal, 8), np.arange(2400) // 200, each=True)
    assert found.inside.tolist() == [True, False]
    assert found.error[1] >= 1 / np.sqrt(12)
    assert found.delay[1] == 11


def test_one_delay_of_all_axes_is_that_of_the_clearer_one_and_without_blocks_it_has_no_error(followed):
    drives, signal = followed
    of_one = signal[:, :1] + [[0.0, 30.0]] * np.random.default_rng(8).standard_normal((2400, 2))
    found = tried(drives, of_one, np.zeros(2400, dtype=int))
    assert found.delay == pytest.approx(2.3, abs=0.1)
    assert np.isnan(found.error)
