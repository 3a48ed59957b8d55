import numpy as np
import pytest

from cpfls_cli.identification.least_squares import solve

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
    np.testing.assert_allclose(system.residual, right_side - matrix @ expected, atol=1e-12)


def test_condition_number_counts_kept_singular_values_only():
    matrix, right_side = low_rank(40, 6, 6)
    assert solve(matrix, right_side, 1e-10).condition_number == pytest.approx(np.linalg.cond(matrix))
    U, _, Vt = np.linalg.svd(matrix, full_matrices=False)
    graded = (U * [8.0, 4.0, 2.0, 1e-3, 1e-9, 0.0]) @ Vt
    assert solve(graded, right_side, 1e-6).condition_number == pytest.approx(8000.0)
    assert solve(graded, right_side, 1e-2).condition_number == pytest.approx(4.0)


def test_losing_rank_never_improves_the_conditioning():
    """Systems whose last singular value falls through the tolerance: the condition number drops, conditioning rises."""
    U, _, Vt = np.linalg.svd(low_rank(40, 4, 4)[0], full_matrices=False)
    systems = [
        solve((U * [8.0, 4.0, third, last]) @ Vt, np.ones(40), 1e-6) for third, last in ((2, 1), (2, 1e-9), (0, 0))
    ]
    assert [system.rank for system in systems] == [4, 3, 2]
    assert [system.condition_number for system in systems] == pytest.approx([8, 4, 2])
    assert [system.conditioning for system in systems] == pytest.approx([8, 2e6, 3e6])


def test_bases_span_rows_and_columns():
    matrix, right_side = low_rank(30, 8, 5)
    system = solve(matrix, right_side, 1e-10)
    np.testing.assert_allclose(system.range_basis.T @ system.range_basis, np.eye(5), atol=1e-13)
    np.testing.assert_allclose(system.row_space @ system.row_space.T, np.eye(5), atol=1e-13)
    np.testing.assert_allclose(matrix @ system.row_space.T @ system.row_space, matrix, atol=1e-12)


def test_rejected_columns_are_orthogonal_to_the_regressor():
    matrix, right_side = low_rank(30, 4, 4)
    others = np.random.default_rng(1).standard_normal((30, 3))
    rejected = solve(matrix, right_side, 1e-10).reject(others)
    expected = others - matrix @ np.linalg.lstsq(matrix, others, rcond=None)[0]
    np.testing.assert_allclose(rejected, expected, atol=1e-13)


def test_no_excitation_at_all():
    system = solve(np.zeros((6, 3)), np.ones(6), 1e-10)
    assert (system.rank, system.condition_number) == (0, np.inf)
    np.testing.assert_array_equal(system.coefficients, np.zeros(3))
    np.testing.assert_array_equal(system.residual, np.ones(6))
