import numpy as np
import pytest

from cpfls_cli.identification.least_squares import Triangle, solve

RNG_SEED = 12


def low_rank(rows, columns, rank):
    rng = np.random.default_rng(RNG_SEED)
    return rng.standard_normal((rows, rank)) @ rng.standard_normal((rank, columns)), rng.standard_normal(rows)


@pytest.mark.parametrize(("rows", "columns", "rank"), [(40, 7, 7), (40, 7, 4), (5, 9, 5), (5, 9, 3), (7, 7, 1)])
def test_minimum_norm_solution_is_that_of_the_pseudoinverse(rows, columns, rank):
    matrix, right_side = low_rank(rows, columns, rank)
    system = solve(matrix, right_side, 1e-10)
    expected = np.linalg.pinv(matrix, rcond=1e-10) @ right_side
    assert system.rank == rank == np.linalg.matrix_rank(matrix)
    np.testing.assert_allclose(system.coefficients, expected, atol=1e-12)


def test_condition_number_counts_kept_singular_values_only():
    matrix, right_side = low_rank(40, 6, 6)
    assert solve(matrix, right_side, 1e-10).condition_number == pytest.approx(np.linalg.cond(matrix))
    U, _, Vt = np.linalg.svd(matrix, full_matrices=False)
    graded = (U * [8.0, 4.0, 2.0, 1e-3, 1e-9, 0.0]) @ Vt
    assert solve(graded, right_side, 1e-6).condition_number == pytest.approx(8000.0)
    assert solve(graded, right_side, 1e-2).condition_number == pytest.approx(4.0)


def test_basis_spans_rows():
    matrix, right_side = low_rank(30, 8, 5)
    system = solve(matrix, right_side, 1e-10)
    np.testing.assert_allclose(system.row_space @ system.row_space.T, np.eye(5), atol=1e-13)
    np.testing.assert_allclose(matrix @ system.row_space.T @ system.row_space, matrix, atol=1e-12)


def test_no_excitation_at_all():
    system = solve(np.zeros((6, 3)), np.ones(6), 1e-10)
    assert (system.rank, system.condition_number) == (0, np.inf)
    np.testing.assert_array_equal(system.coefficients, np.zeros(3))


# Blocks of fewer rows than columns, of as many, of one row, and all at once.
CUTS = {"one": [], "few": [3, 6, 9], "single rows": range(1, 40), "unequal": [1, 8, 30]}


@pytest.mark.parametrize("cuts", CUTS)
@pytest.mark.parametrize(("columns", "rank"), [(7, 7), (7, 4), (50, 40), (0, 0)])
def test_blocks_of_rows_are_solved_as_one(cuts, columns, rank):
    matrix, right_side = low_rank(40, columns, rank)
    blocks = zip(np.split(matrix, CUTS[cuts]), np.split(right_side, CUTS[cuts]), strict=True)
    system, whole = Triangle.of(blocks).solve(1e-10), solve(matrix, right_side, 1e-10)
    assert system.rank == whole.rank == rank
    np.testing.assert_allclose(system.coefficients, whole.coefficients, atol=1e-12)
    np.testing.assert_allclose(system.singular_values[:rank], whole.singular_values[:rank], rtol=1e-12)


def test_penalty_below_is_that_of_the_ridge_problem():
    matrix, right_side = low_rank(40, 7, 4)
    penalty = np.diag(np.linspace(0.5, 2.0, 7))
    system = Triangle.of([(matrix, right_side)]).below(penalty).solve(1e-10)
    expected = np.linalg.solve(matrix.T @ matrix + penalty.T @ penalty, matrix.T @ right_side)
    np.testing.assert_allclose(system.coefficients, expected, atol=1e-12)


def test_no_rows_at_all_are_an_error():
    with pytest.raises(ValueError, match="no rows"):
        Triangle.of([])
