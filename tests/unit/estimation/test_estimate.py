"""Estimates by instruments, their first stage and spectra."""

import numpy as np
import pytest

from cpfls_cli.blocks import contiguous
from cpfls_cli.estimation.estimate import (
    FOLDS,
    Normal,
    Prior,
    conditional_strength,
    estimate,
    first_stage_fit,
    first_stage_fit_by_run,
    fits_of_others,
    positive_ratio,
    power_between,
)
from cpfls_cli.estimation.spectra import block_spectra, cut_blocks, eroded, transforms, window_starts, without_slow


def of_rows(residual, slopes, instruments, weight, block):
    """Sum rows of equations by block."""
    weighed, own = instruments * weight[:, None], [block == number for number in range(block[-1] + 1)]
    return Normal(
        np.array([weighed[rows].T @ slopes[rows] for rows in own]),
        np.array([weighed[rows].T @ residual[rows] for rows in own]),
    )


def closed_loop(rng, rows=4000, instrument=1.0):
    """Rows whose input answers the disturbance of the output: slope 2 of the first input, -1 of the second."""
    z = rng.standard_normal((rows, 2))
    disturbance = rng.standard_normal(rows)
    x = instrument * z @ [[1.0, 0.3], [0.2, 1.0]] - 0.8 * disturbance[:, None]
    return z, x, x @ [2.0, -1.0] + disturbance


def fit(instruments, x, y, blocks=20, **more):
    block = contiguous(len(y), blocks)
    return estimate(lambda d: of_rows(y - x @ d, x, instruments, np.ones(len(y)), block), np.zeros(2), **more)


def test_instruments_give_the_slopes_that_least_squares_misses():
    z, x, y = closed_loop(np.random.default_rng(1))
    found, plain = fit(z, x, y), fit(x, x, y)
    np.testing.assert_allclose(found.values, np.linalg.solve(z.T @ x, z.T @ y), rtol=1e-9)
    np.testing.assert_allclose(plain.values, np.linalg.lstsq(x, y, rcond=None)[0], rtol=1e-9)
    assert np.abs(found.values - [2.0, -1.0]).max() < 0.1 < np.abs(plain.values - [2.0, -1.0]).min()


def test_covariance_is_that_of_the_jackknife():
    z, x, y = closed_loop(np.random.default_rng(2), rows=400)
    found, block = fit(z, x, y, blocks=8), contiguous(400, 8)
    left_out = np.array(
        [np.linalg.solve(z[block != b].T @ x[block != b], z[block != b].T @ y[block != b]) for b in range(8)]
    )
    apart = left_out - left_out.mean(axis=0)
    np.testing.assert_allclose(found.covariance, 7 / 8 * apart.T @ apart, rtol=1e-6)


def test_an_interval_covers_as_often_as_it_says():
    rng, inside = np.random.default_rng(3), 0
    for _ in range(100):
        found = fit(*closed_loop(rng, rows=300), blocks=12)
        inside += abs(found.values[0] - 2.0) <= found.half(np.array([1.0, 0.0]))
    assert 88 <= inside <= 100


def test_a_prior_weighs_as_its_precision():
    z, x, y = closed_loop(np.random.default_rng(4))
    found = fit(z, x, y, prior=Prior(np.array([5.0, 5.0]), np.array([0.02, np.inf])))
    matrix = z.T @ x + np.diag([1 / 0.02**2, 0.0])
    np.testing.assert_allclose(found.values, np.linalg.solve(matrix, z.T @ y + [5.0 / 0.02**2, 0.0]), rtol=1e-6)
    held = np.linalg.inv(matrix) @ np.diag([1 / 0.02**2, 0.0]) @ np.linalg.inv(matrix).T
    assert found.covariance[0, 0] > held[0, 0]


def test_a_number_that_is_not_linear_settles_where_the_score_is_zero():
    rng = np.random.default_rng(5)
    time, block = np.linspace(0, 3, 300), contiguous(300, 10)
    y = 2.0 * np.exp(-0.7 * time) + 0.01 * rng.standard_normal(300)

    def equations(values):
        curve = np.exp(values[0] - values[1] * time)
        slopes = np.stack([curve, -time * curve], axis=1)
        return of_rows(y - curve, slopes, slopes, np.full(300, 1e4), block)

    found = estimate(equations, np.array([0.0, 0.1]))
    assert found.settled
    np.testing.assert_allclose(found.values, [np.log(2.0), 0.7], atol=0.02)


def test_strength_shows_a_weak_instrument():
    rng = np.random.default_rng(6)
    strong, weak = (fit(*closed_loop(rng, instrument=size)).strength for size in (1.0, 0.0))
    assert strong.min() > 50
    assert weak.max() < 10
    normal = Normal(np.array([[[30.0]], [[20.0]]]), np.zeros((2, 1)), np.array([[5.0]]))
    assert conditional_strength(normal, Prior.none(1))[0] == pytest.approx(10.0)


@pytest.mark.parametrize("size", [3.0, 0.3, 0.05])
def test_the_interval_of_a_ratio_is_what_a_test_does_not_refuse(size):
    from scipy.special import stdtrit

    rng = np.random.default_rng(7)
    denominator = size + rng.standard_normal(12)
    numerator = 2.0 * denominator + rng.standard_normal(12)
    low, high = positive_ratio(numerator, denominator)
    tried = np.linspace(0.01, 30, 3000)
    rest = numerator - tried[:, None] * denominator
    kept = np.abs(rest.mean(axis=1)) <= stdtrit(11, 0.975) * rest.std(axis=1, ddof=1) / np.sqrt(12)
    assert ((tried[kept] >= low - 1e-9) & (tried[kept] <= high + 1e-9)).all()
    if np.isfinite(high):
        assert high - tried[kept].max() < 0.02


def test_values_and_errors_are_those_of_another_package():
    """Two-stage least squares with five instruments for two inputs, errors by clusters; those are 2 % narrower."""
    from linearmodels.iv import IV2SLS  # Loads pandas: longer than all tests of this file run.

    rng, block = np.random.default_rng(8), contiguous(3000, 60)
    more, disturbance = rng.standard_normal((3000, 5)), rng.standard_normal(3000) + rng.standard_normal(60)[block]
    x = more @ rng.standard_normal((5, 2)) - 0.8 * disturbance[:, None]
    y = x @ [2.0, -1.0] + disturbance
    weight = rng.uniform(0.5, 2.0, 3000)
    root = np.sqrt(weight)[:, None]
    first = more @ np.linalg.lstsq(root * more, root * x, rcond=None)[0]
    found = estimate(lambda d: of_rows(y - x @ d, x, first, weight, block), np.zeros(2))
    other = IV2SLS(y, None, x, more, weights=weight).fit(cov_type="clustered", clusters=block)
    np.testing.assert_allclose(found.values, other.params, rtol=1e-8)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), other.std_errors, rtol=0.06)


def test_a_power_lies_between_its_bounds_whichever_side_is_noisy():
    """What it goes with as well is that of two-stage least squares of another package."""
    from linearmodels.iv import IV2SLS

    rng = np.random.default_rng(12)
    by, slow, answers = rng.standard_normal(4000), rng.standard_normal(4000), rng.standard_normal((2, 4000))
    of = 2.0 * by + 1.5 * slow
    for noisy in (0.0, 0.6):
        seen = of + noisy * answers[0], by + (0.6 - noisy) * answers[1]
        low, high = power_between(*seen, slow[:, None], slow[:, None])[:2]
        assert low < 2.02
        assert high > max(1.98, low)
    # Where `by` answers what moves the other, as a voltage that sinks under load does.
    moved = slow - 0.5 * (by + answers[0])
    z = np.column_stack([np.ones(4000), slow])
    found = power_between(of, by + answers[0], moved[:, None], z)
    left, right = by + answers[0], np.column_stack([of, np.ones(4000)])
    other = IV2SLS(left, right, moved, slow).fit().params
    np.testing.assert_allclose([1 / found[1], found[2]], other.iloc[[0, 2]], rtol=1e-8)


def test_each_part_is_predicted_by_the_others():
    rng = np.random.default_rng(1)
    z, x = rng.normal([5.0, 0.0, -2.0], 1.0, (200, 3)), rng.standard_normal((200, 2, 2))
    found, part = first_stage_fit(z, x, ridge=0.0), contiguous(200, FOLDS)
    both = np.column_stack([np.ones(200), z])
    for fold in range(FOLDS):
        fit = np.linalg.lstsq(both[part != fold], x[part != fold].reshape(-1, 4), rcond=None)[0]
        np.testing.assert_allclose(found[part == fold].reshape(-1, 4), both[part == fold] @ fit, rtol=1e-9)
    runs = first_stage_fit_by_run({2: z[:120], 0: z[120:]}, {0: x[120:], 2: x[:120]}, 0.0)
    np.testing.assert_array_equal(np.concatenate([runs[2], runs[0]]), found)
    assert first_stage_fit_by_run({}, []) == {}


def test_neighbours_are_left_out_too():
    z, x = np.random.default_rng(2).standard_normal((2, 8, 50, 2))
    ztz, ztx = z.swapaxes(1, 2) @ z, z.swapaxes(1, 2) @ x
    found = fits_of_others(ztz, ztx, 0.0, neighbours=1)
    far = [0, 1, 5, 6, 7]
    expected = np.linalg.lstsq(z[far].reshape(-1, 2), x[far].reshape(-1, 2), rcond=None)[0]
    np.testing.assert_allclose(found[3], expected, rtol=1e-9)


def test_derivatives_by_parts_are_those_of_the_signal():
    period, length = 0.002, 500
    time = np.arange(2000) * period
    signal, slope, bend = (
        np.real((2j * np.pi * 3.1) ** order * np.exp(2j * np.pi * 3.1 * time + 0.4j)) for order in range(3)
    )
    begins = window_starts(np.ones(2000, dtype=bool), length)
    for each, actual in zip(transforms(signal, begins, length, period, 2), (signal, slope, bend), strict=True):
        wanted = transforms(actual, begins, length, period)[0]
        np.testing.assert_allclose(each[:, :10], wanted[:, :10], atol=2e-4 * np.abs(wanted).max())


def test_windows_lie_in_what_is_usable():
    usable = np.ones(100, dtype=bool)
    usable[[30, 31]] = False
    assert window_starts(usable, 20).tolist() == [0, 10, 32, 42, 52, 62, 72]
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
    assert np.abs(without_slow(slow + fast, np.ones(4000, dtype=bool), 150) - fast)[500:-500].max() < 0.15


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
