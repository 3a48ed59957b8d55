"""The estimator against closed formulas."""

import numpy as np
import pytest

from cpfls_cli.blocks import contiguous
from cpfls_cli.estimation.estimate import Normal, Prior, conditional_strength, estimate, positive_ratio


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
    prior = Prior(np.array([5.0, 5.0]), np.array([0.02, np.inf]))
    found = fit(z, x, y, prior=prior)
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


def test_strength_tells_a_weak_instrument():
    rng = np.random.default_rng(6)
    strong, weak = (fit(*closed_loop(rng, instrument=size)).strength for size in (1.0, 0.0))
    assert strong.min() > 50
    assert weak.max() < 10


def test_strength_over_chance_is_the_ratio_for_a_number_alone():
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
