"""Foundations: filters, units, blocks, damped least squares, delay and lag."""

from typing import get_args

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.signal import butter, lfilter, lfilter_zi, sosfiltfilt

from cpfls_cli.blocks import contiguous, half_width, jackknife_covariance, jackknife_error, mean_error, serial_error
from cpfls_cli.errors import InputError
from cpfls_cli.filters import SecondOrder
from cpfls_cli.flightlog.smoothing import low_pass
from cpfls_cli.lag import best_delay, delayed, fit_delay, lagged
from cpfls_cli.least_squares import damped_step
from cpfls_cli.units import KNOWN_UNITS, UnitName, to_si

WAVES = np.random.default_rng(1).standard_normal((400, 3)) + np.array([0.0, 5.0, -80.0])
BETWEEN = pytest.mark.parametrize("between", ["cubic", "linear", "previous"])


@pytest.mark.parametrize("upper", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.5, 1.0, 2.0)])
def test_a_filter_begins_settled_and_goes_step_by_step_as_along(upper):
    made = SecondOrder.of(0.01, 0.3, upper)
    state = made.settled(WAVES[0])
    np.testing.assert_allclose(state, lfilter_zi(made.over, made.under)[:, None] * WAVES[0], atol=1e-9)
    along, steps = made.along(WAVES), []
    for value in WAVES:
        passed, state = made.step(value, state)
        steps.append(passed)
    np.testing.assert_allclose(along, steps, atol=1e-9)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 7, 12])
@pytest.mark.parametrize("cutoff_hz", [0.3, 10.0, 49.0])
def test_a_low_pass_is_padded_for_three_periods(order, cutoff_hz):
    padding = min(len(WAVES) - 1, int(np.ceil(3 * 100.0 / cutoff_hz)))
    expected = sosfiltfilt(butter(order, cutoff_hz, fs=100.0, output="sos"), WAVES, axis=0, padlen=padding)
    np.testing.assert_allclose(low_pass(WAVES, 100.0, cutoff_hz, order), expected, atol=1e-8)


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (180.0, "deg", np.pi),
        (90.0, "deg/s", np.pi / 2),
        (60.0, "rpm", 2 * np.pi),
        (1500.0, "us", 1.5e-3),
        (2.0, "g", 19.6133),
        (250.0, "N mm", 0.25),
        (3.0, "N·m", 3.0),
        (7.0, "mm/s", 0.007),
        (0.3, "N", 0.3),
        (16.8, "V", 16.8),
    ],
)
def test_a_value_converts_to_si(value, unit, expected):
    assert to_si(np.array([value]), unit)[0] == pytest.approx(expected, rel=1e-12)


def test_units_are_those_of_a_config_and_another_is_refused_with_the_nearest_names():
    assert set(KNOWN_UNITS) == set(get_args(UnitName))
    with pytest.raises(InputError, match=r"'degs'.*did you mean 'deg/s' or 'deg'"):
        to_si(np.zeros(1), "degs")


def test_of_a_mean_the_jackknife_says_what_its_standard_error_says():
    values = np.random.default_rng(2).standard_normal((12, 3)) @ np.triu(np.ones((3, 3)))
    left_out = (values.sum(axis=0) - values) / (len(values) - 1)
    np.testing.assert_allclose(jackknife_error(left_out), mean_error(values), rtol=1e-12)
    np.testing.assert_allclose(jackknife_covariance(left_out), np.cov(values.T) / len(values), rtol=1e-12)
    assert jackknife_error(left_out[:, 0]) == pytest.approx(mean_error(values)[0])


@pytest.mark.parametrize(("memory", "plain"), [(0.01, 0.95), (2.0, 0.87)])
def test_intervals_hold_where_neighbouring_blocks_correlate(memory, plain):
    """Means of a Gauss-Markov process in 30 blocks, four or two of its memories long, against its known mean."""
    rng, keep = np.random.default_rng(3), np.exp(-0.1 / memory)
    drawn = rng.standard_normal((3000, 1300)) * np.sqrt(1 - keep**2)
    blocks = lfilter([1.0], [1.0, -keep], drawn)[:, 100:].reshape(3000, 30, 40).mean(axis=2)
    left_out = ((blocks.sum(axis=1, keepdims=True) - blocks) / 29).T
    error = np.abs(blocks.mean(axis=1))
    held = [np.mean(error < half_width(of(left_out), 30)) for of in (jackknife_error, serial_error)]
    assert held[0] == pytest.approx(plain, abs=0.02)
    assert held[1] == pytest.approx(0.955 if memory < 1 else 0.92, abs=0.015)


def test_intervals_are_those_of_students_t():
    assert half_width(np.array([2.0]), 10) == pytest.approx(2 * 2.262157)


@pytest.mark.parametrize(("samples", "blocks"), [(10, 3), (7, 7), (3, 5), (0, 4)])
def test_blocks_are_contiguous_and_about_equal(samples, blocks):
    number = contiguous(samples, blocks)
    assert len(number) == samples
    if samples:
        assert (np.diff(number) >= 0).all()
        assert np.ptp(np.bincount(number, minlength=blocks)) <= 1


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("damping", [1e-6, 1.0])
def test_a_step_is_the_minimum_of_the_damped_model_between_the_bounds(seed, damping):
    rng = np.random.default_rng(seed)
    J, r, weights = rng.standard_normal((40, 6)), rng.standard_normal(40), rng.uniform(0.1, 1.0, 6)
    weights[0] = 1.0
    normal, gradient = J.T @ J, 3.0 * J.T @ r
    damped = np.linalg.cholesky(normal + damping * np.diag(np.diag(normal))).T
    low = 0.85 * weights - weights
    expected = lsq_linear(damped, -np.linalg.solve(damped.T, gradient), (low, np.fmax(1.0 - weights, 1e-300)))
    found = damped_step(normal, gradient, damping, low, 1.0 - weights)

    def model(step):
        return gradient @ step + 0.5 * step @ damped.T @ damped @ step

    assert np.all(found >= low - 1e-15)
    assert np.all(weights + found <= 1.0)
    # Weights at a bound stay there, which the true minimum need not do: little is lost.
    assert model(found) <= 0.9 * model(expected.x)
    free = (found > low) & (weights + found < 1.0)
    np.testing.assert_allclose((gradient + damped.T @ damped @ found)[free], 0.0, atol=1e-9)


def test_numbers_that_move_nothing_or_are_on_their_bound_stay():
    found = damped_step(np.diag([0.0, 2.0]), np.array([0.0, 0.1]), 1e-9, -np.ones(2), np.ones(2))
    np.testing.assert_allclose(found, [0.0, -0.05])
    hessian, gradient = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([-1.0, -1.0])
    found = damped_step(hessian, gradient, 0.0, np.full(2, -5.0), np.array([0.0, 5.0]))
    np.testing.assert_allclose(found, [0.0, 1.0])


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
    best, inside = best_delay(delays, (delays[:, None] - [0.013, -0.041, 0.2, -0.3]) ** 2)
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
