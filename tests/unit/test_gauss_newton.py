"""A damped step within bounds, beside the true minimum within them."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from cpfls_cli.gauss_newton import damped_step


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


def test_numbers_that_move_nothing_stay():
    found = damped_step(np.diag([0.0, 2.0]), np.array([0.0, 0.1]), 1e-9, -np.ones(2), np.ones(2))
    np.testing.assert_allclose(found, [0.0, -0.05])


def test_a_number_on_its_bound_stays_there_and_the_others_move_as_without_it():
    hessian, gradient = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([-1.0, -1.0])
    found = damped_step(hessian, gradient, 0.0, np.full(2, -5.0), np.array([0.0, 5.0]))
    np.testing.assert_allclose(found, [0.0, 1.0])
