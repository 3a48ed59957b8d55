"""Least squares whose columns are noisy themselves, against the normal equations without that noise."""

import numpy as np
import pytest

from cpfls_cli.gap.balance.refine import Equations

RNG = np.random.default_rng(8)
ROWS = 4000
TIME = np.linspace(0.0, 1.0, ROWS)
CLEAN = np.column_stack([np.sin(20 * TIME), np.cos(33 * TIME), np.sin(20 * TIME + 0.4), np.zeros(ROWS)])
TRUE = np.array([1.0, -2.0, 0.5, 0.0])
MIXING = np.array([[0.3, 0.0, 0.1, 0.0], [0.0, 0.2, 0.2, 0.0]])


def drawn(size, right=0.0, rng=RNG):
    """Columns with correlated noise, a right side that shares some of it, and noise like both drawn again."""

    def noise():
        own = size * rng.standard_normal((ROWS, 2))
        return np.column_stack([own @ MIXING, right * own[:, 0]])

    met = noise()
    return Equations(CLEAN + met[:, :-1], CLEAN @ TRUE + met[:, -1] + 0.01 * rng.standard_normal(ROWS), noise())


def test_without_noise_it_is_least_squares():
    rows = drawn(0.0)
    plain = np.linalg.lstsq(rows.columns[:, :3], rows.right, rcond=None)[0]
    assert rows.solve() == pytest.approx([*plain, 0.0], rel=1e-9, abs=1e-12)
    assert rows.trusted == 1.0


def test_noise_is_taken_off_the_normal_equations():
    rows = drawn(0.6, right=0.4)
    noise, own = rows.noise[:, :3], rows.noise[:, -1]
    gram = rows.columns[:, :3].T @ rows.columns[:, :3] - noise.T @ noise
    moment = rows.columns[:, :3].T @ rows.right - noise.T @ own
    assert rows.trusted == 1.0
    assert rows.solve()[:3] == pytest.approx(np.linalg.solve(gram, moment), rel=1e-8)


def test_numbers_that_noise_shrinks_come_out_as_they_are():
    """Against 200 draws: the mean is the truth to three of its standard errors, that of least squares is not."""
    rng = np.random.default_rng(3)
    drawn_rows = [drawn(0.8, right=0.4, rng=rng) for _ in range(200)]
    found = np.array([rows.solve()[:3] for rows in drawn_rows])
    plain = np.array([np.linalg.lstsq(rows.columns[:, :3], rows.right, rcond=None)[0] for rows in drawn_rows])
    error = found.std(axis=0) / np.sqrt(len(found))
    assert np.all(np.abs(found.mean(axis=0) - TRUE[:3]) < 3 * error)
    assert np.abs(plain.mean(axis=0) - TRUE[:3]).max() > 0.1


def test_no_more_than_half_of_any_combination_is_taken_for_noise():
    """The difference of the first and the third column is mostly noise."""
    rows = drawn(5.0)
    assert 0.0 < rows.trusted < 1.0
    columns, _ = rows.root
    left = np.linalg.eigvals(
        np.linalg.solve(rows.columns[:, :3].T @ rows.columns[:, :3], (columns.T @ columns)[:3, :3])
    )
    assert left.real.min() == pytest.approx(0.5, rel=1e-6)


def test_about_a_solution_nothing_is_left_to_do():
    rows = drawn(0.6, right=0.4)
    there = rows.around(rows.solve(), np.array([True, True, True, False]), np.zeros((ROWS, 0)))
    assert there.solve() == pytest.approx(np.zeros(3), abs=1e-9)
