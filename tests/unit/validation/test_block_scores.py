"""Sums over blocks against the rows written out: blocks left out, residuals corrected, what a penalty hides."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import linalg

from cpfls_cli.validation.bands import BlockScores

BLOCKS, ROWS, PARAMETERS = 6, 9, 5
TOLERANCE = 1e-10


@pytest.fixture(params=[0.0, 3.0], ids=["free", "penalised"])
def case(request):
    rng = np.random.default_rng(1)
    A, y = rng.standard_normal((BLOCKS, ROWS, PARAMETERS)), rng.standard_normal((BLOCKS, ROWS))
    penalty = request.param * np.array([0.0, 0.0, 1.0, 1.0, 2.0])
    x = solved(A, y, penalty)
    gram, score = A.swapaxes(1, 2) @ A, np.einsum("bnp,bn->bp", A, y - A @ x)
    return SimpleNamespace(A=A, y=y, penalty=penalty, x=x, scores=BlockScores(gram, score, penalty, x))


def solved(A, y, penalty):
    rows = np.vstack([A.reshape(-1, PARAMETERS), np.diag(np.sqrt(penalty))])
    return linalg.lstsq(rows, np.append(y.ravel(), np.zeros(PARAMETERS)))[0]


def test_power_one_is_what_leaving_a_block_out_changes(case):
    """The jackknife: each draw of one block alone is a least-squares problem without it."""
    scores = BlockScores(case.scores.gram, case.scores.score, case.penalty, case.x, power=1.0)
    for block, moved in enumerate(scores.draws(np.eye(BLOCKS), TOLERANCE)):
        left = np.arange(BLOCKS) != block
        np.testing.assert_allclose(moved, case.x - solved(case.A[left], case.y[left], case.penalty), atol=1e-12)


@pytest.mark.parametrize("power", [0.0, 0.5, 0.75])
def test_other_powers_correct_the_residuals_themselves(case, power):
    scores = BlockScores(case.scores.gram, case.scores.score, case.penalty, case.x, power)
    inverse = np.linalg.inv(np.sum(case.scores.gram, axis=0) + np.diag(case.penalty))
    for A, y, moved in zip(case.A, case.y, scores.draws(np.eye(BLOCKS), TOLERANCE), strict=True):
        rest = np.eye(ROWS) - A @ inverse @ A.T
        residual = linalg.fractional_matrix_power(rest, -power) @ (y - A @ case.x)
        np.testing.assert_allclose(moved, inverse @ A.T @ residual, atol=1e-12)


def test_another_penalty_is_that_of_all_rows_solved_again(case):
    penalty = np.array([0.0, 0.0, 0.1, 0.3, 0.2])
    other = case.scores.with_penalty(penalty, TOLERANCE)
    np.testing.assert_allclose(other.parameters, solved(case.A, case.y, penalty), atol=1e-12)
    residual = case.y - case.A @ other.parameters
    np.testing.assert_allclose(other.score, np.einsum("bnp,bn->bp", case.A, residual), atol=1e-12)
    np.testing.assert_array_equal(other.penalty, penalty)


def test_left_is_what_samples_do_not_tell_of_values_that_are_true(case):
    values = (case.penalty > 0) * np.random.default_rng(3).standard_normal((4, PARAMETERS))
    expected = [value - solved(case.A, case.A @ value, case.penalty) for value in values]
    np.testing.assert_allclose(case.scores.undetermined(values, TOLERANCE), expected, atol=1e-12)


@pytest.mark.parametrize("penalty", [0.0, 1e-30, 1e-3], ids=["none", "rounding", "some"])
def test_all_is_left_of_a_direction_that_no_sample_sees(penalty):
    gram = np.diag([4.0, 1.0, 0.0])[None]
    scores = BlockScores(gram, np.zeros((1, 3)), np.full(3, penalty), np.ones(3))
    left = scores.undetermined(np.array([[3.0, -2.0, 5.0]]), TOLERANCE)
    np.testing.assert_allclose(left, [[3.0 * penalty / (4 + penalty), -2.0 * penalty / (1 + penalty), 5.0]], atol=1e-15)


def test_solution_is_that_of_least_squares(case):
    scores = BlockScores(case.scores.gram, np.einsum("bnp,bn->bp", case.A, case.y), case.penalty, 0 * case.x)
    np.testing.assert_allclose(scores.solution(TOLERANCE), case.x, atol=1e-12)


def test_directions_that_nothing_determines_stay_where_they_are():
    rng = np.random.default_rng(2)
    A = rng.standard_normal((BLOCKS, ROWS, 4)) @ rng.standard_normal((4, PARAMETERS))
    scores = BlockScores(
        A.swapaxes(1, 2) @ A,
        np.einsum("bnp,bn->bp", A, rng.standard_normal((BLOCKS, ROWS))),
        np.zeros(PARAMETERS),
        np.zeros(PARAMETERS),
    )
    moved = scores.draws(rng.standard_normal((50, BLOCKS)), 1e-6)
    null = linalg.null_space(A.reshape(-1, PARAMETERS))
    assert null.shape[1] == 1
    assert np.abs(moved).max() > 0.01
    np.testing.assert_allclose(moved @ null, 0.0, atol=1e-9)


def test_a_block_that_alone_determines_a_direction_gives_finite_draws():
    gram = np.zeros((2, 2, 2))
    gram[0, 0, 0] = gram[1, 1, 1] = 1.0
    scores = BlockScores(gram, np.zeros((2, 2)), np.zeros(2), np.ones(2), power=1.0)
    np.testing.assert_array_equal(scores.draws(np.ones((3, 2)), TOLERANCE), np.zeros((3, 2)))
