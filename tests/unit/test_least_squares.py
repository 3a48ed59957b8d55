"""Least squares of one structure, and how well a flight excites it."""

import numpy as np
import pytest

from cpfls_cli.dynamics import outside_visited, visited_cells
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.findings import rule_excitation
from cpfls_cli.identification.samples import Ready, Samples
from cpfls_cli.least_squares import (
    SMALLEST_SINGULAR_SHARE,
    NormalEquations,
    Triangle,
    quick_solution,
    solve,
    solve_normal,
)
from cpfls_cli.regressor.regressor import Motion, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure

RNG_SEED = 12
PARAMETERS = 40
DEGREE = np.pi / 180


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


def columns(singular_values, rows=200, seed=32):
    """A matrix of given singular values, a right-hand side, and the parameters behind it."""
    rng = np.random.default_rng(seed)
    U, V = (np.linalg.qr(rng.standard_normal((n, len(singular_values))))[0] for n in (rows, len(singular_values)))
    A, x = (U * singular_values) @ V.T, rng.standard_normal(len(singular_values))
    return A, A @ x + 1e-3 * rng.standard_normal(rows), x


def solved(A, y, penalty=None, rank_tolerance=1e-10):
    def project(x, directions):
        along = A @ directions
        return along.T @ along, A.T @ (y - A @ x)

    penalty = np.zeros(A.shape[1]) if penalty is None else penalty
    return solve_normal(NormalEquations(A.T @ A, A.T @ y, penalty), rank_tolerance, project)


def decay(condition, kind, scale=1.0):
    """Singular values in three shapes: even on a logarithm, all but the last near one, a cluster of small ones."""
    if kind == "even":
        return scale * np.geomspace(1.0, 1.0 / condition, PARAMETERS)
    values = np.linspace(1.0, 0.5, PARAMETERS)
    last = 1 if kind == "one" else 6
    values[-last:] = np.linspace(1.0, 1.2, last) / condition
    return scale * values


@pytest.mark.parametrize("scale", [1.0, 1e6, 1e-6])
@pytest.mark.parametrize("kind", ["even", "one", "cluster"])
@pytest.mark.parametrize("condition", [3.0, 5e3, 2e4, 1e5, 1e6])
def test_condition_number_has_six_digits(condition, kind, scale):
    A, y, _ = columns(decay(condition, kind, scale))
    found = solved(A, y).conditioning
    assert (found, found) == (pytest.approx(np.linalg.cond(A), rel=1e-6), pytest.approx(condition, rel=1e-6))


@pytest.mark.parametrize("kind", ["even", "one", "cluster"])
@pytest.mark.parametrize("condition", [3.0, 5e3, 2e4, 1e5, 1e6])
def test_residual_is_that_of_the_decomposition(condition, kind):
    A, y, _ = columns(decay(condition, kind))
    best = y - A @ np.linalg.lstsq(A, y, rcond=None)[0]
    residual = y - A @ solved(A, y).parameters
    assert np.mean(residual**2) == pytest.approx(np.mean(best**2), rel=1e-9)
    np.testing.assert_allclose(residual, best, atol=1e-7 * np.abs(best).max())


@pytest.mark.parametrize("condition", [3.0, 2e4, 1e6])
def test_penalised_system_is_solved_with_its_penalty(condition):
    A, y, _ = columns(decay(condition, "even"))
    penalty = np.where(np.arange(PARAMETERS) < 6, 0.0, 1e-9)
    stacked = np.vstack([A, np.diag(np.sqrt(penalty))])
    expected = np.linalg.lstsq(stacked, np.append(y, np.zeros(PARAMETERS)), rcond=None)[0]
    found = solved(A, y, penalty)
    np.testing.assert_allclose(A @ found.parameters, A @ expected, atol=1e-9)
    assert found.conditioning == pytest.approx(np.linalg.cond(stacked), rel=1e-6)


def test_losing_rank_never_improves_the_conditioning():
    """Systems whose last singular value falls through the tolerance: conditioning only rises."""
    assert [
        solved(columns([8.0, 4.0, third, last])[0], np.ones(200), rank_tolerance=1e-6).conditioning
        for third, last in ((2, 1), (2, 1e-9), (0, 0))
    ] == pytest.approx([8, 2e6, 3e6])


@pytest.mark.parametrize("rank_tolerance", [1e-10, 1e-6, 1e-4])
@pytest.mark.parametrize("seed", range(3))
def test_conditioning_is_ordered_to_the_end(rank_tolerance, seed):
    """Whatever the condition number, more of it is never better, nor is one more dependent column."""
    conditions = np.geomspace(10, 1e18, 60)
    worse = [
        solved(*columns(decay(condition, "one"), seed=seed)[:2], rank_tolerance=rank_tolerance).conditioning
        for condition in conditions
    ]
    assert np.isfinite(worse).all()
    assert np.all(np.diff(worse) >= -1e-6 * np.array(worse[1:]))
    assert worse[-1] >= 2 / max(rank_tolerance, SMALLEST_SINGULAR_SHARE)
    fewer = decay(10.0, "one")
    fewer[-2:] = 0.0
    assert solved(*columns(fewer, seed=seed)[:2], rank_tolerance=rank_tolerance).conditioning > worse[-1]


def test_dependent_columns_get_the_parameters_of_smallest_norm():
    values = np.geomspace(1.0, 0.1, PARAMETERS)
    values[-5:] = 0.0
    A, y, _ = columns(values)
    found = solved(A, y)
    np.testing.assert_allclose(found.parameters, np.linalg.pinv(A, rcond=1e-10) @ y, atol=1e-9)
    assert found.conditioning == pytest.approx(6 / SMALLEST_SINGULAR_SHARE)


def test_normal_equations_without_any_excitation():
    found = solved(np.zeros((6, 3)), np.ones(6))
    assert found.conditioning == np.inf
    np.testing.assert_array_equal(found.parameters, np.zeros(3))


@pytest.mark.parametrize("condition", [3.0, 1e3])
def test_quick_solution(condition):
    A, y, _ = columns(decay(condition, "even"))
    A = A * np.geomspace(1e-3, 1e3, PARAMETERS)
    penalty = np.full(PARAMETERS, 1e-3)
    equations = NormalEquations(A.T @ A, A.T @ y, penalty)
    parameters, (factor, lower), scale = quick_solution(equations)
    expected = np.linalg.solve(A.T @ A + np.diag(penalty), A.T @ y)
    np.testing.assert_allclose(A @ parameters, A @ expected, atol=1e-5 * np.abs(y).max())
    triangle = np.tril(factor) if lower else np.triu(factor).T
    unscaled = (triangle @ triangle.T) / scale / scale[:, None]
    np.testing.assert_allclose(unscaled, equations.matrix, rtol=1e-6, atol=1e-9 * np.max(equations.matrix))


def test_quick_solution_of_dependent_columns_is_finite():
    A, y, _ = columns(decay(3.0, "even"))
    A[:, 3], A[:, 7] = A[:, 2], 0.0
    parameters, _, _ = quick_solution(NormalEquations(A.T @ A, A.T @ y, np.zeros(PARAMETERS)))
    assert np.isfinite(parameters).all()
    best = np.linalg.lstsq(A, y, rcond=None)[0]
    np.testing.assert_allclose(A @ parameters, A @ best, atol=1e-5 * np.abs(y).max())


def at(roll, pitch):
    return np.array([[roll * DEGREE, pitch * DEGREE, 0.3]])


def test_visited_cell_and_its_neighbours_count_as_inside():
    visited = visited_cells([at(12, -3)])
    assert visited.sum() == 9
    assert not outside_visited(visited, at(12, -3))
    assert not outside_visited(visited, at(17, -8))
    assert outside_visited(visited, at(22, -3))
    assert outside_visited(visited, at(12, 6))


def test_cells_wrap_at_half_a_turn():
    visited = visited_cells([at(179, 0)])
    for roll in (-179, 179, 181, 179 - 360, 174):
        assert not outside_visited(visited, at(roll, 0))
    assert outside_visited(visited, at(-174, 0))
    edges = np.array([[np.pi, -np.pi, 0.0], [-np.pi, np.pi, 0.0], [np.nextafter(-np.pi, -4), 0.0, 0.0]])
    assert not outside_visited(visited_cells([edges]), edges).any()


def excitation(attitude, noise=0.0, **settings):
    rng = np.random.default_rng(15)
    motion = Motion(attitude, rng.standard_normal(attitude.shape), rng.standard_normal(attitude.shape))
    structure = model_structure(StructureSettings(consequents="seesaw", products="additive", **settings))
    data = TorqueData(0.01 * np.arange(len(motion)), motion, np.zeros_like(attitude))
    samples = Samples.of(Ready(data, rigid=False), structure, data_ranges(structure, attitude))
    return rule_excitation(samples, uniform_breakpoints(structure), noise, 0.5, 1e-10)


def test_rules_that_never_fire_are_named():
    """Angles within a quarter turn on either side of zero never reach the function at pi (rule 3 of 4)."""
    found = excitation(np.random.default_rng(16).uniform(-1.5, 1.5, (400, 3)), membership_functions=5)
    silent = {name for name, excited in zip(found.name, found.excited, strict=True) if not excited}
    third_by_third = {
        f"{name} rule {4 * i + j + 1}" for name in ("D23", "D33") for i in range(4) for j in range(4) if 2 in (i, j)
    }
    assert silent == {"D13 rule 3", "D22 rule 3"} | third_by_third
    never = [name for name, strength in zip(found.name, found.firing, strict=True) if strength == 0]
    assert set(never) == silent


def test_every_rule_is_excited_on_the_full_circle():
    found = excitation(np.random.default_rng(16).uniform(-np.pi, np.pi, (2000, 3)), membership_functions=5)
    assert len(found.name) == 1 + 4 + 4 + 16 + 16
    assert found.excited.all()
    np.testing.assert_allclose(found.determined, 1.0, atol=1e-9)


def test_one_sample_determines_three_directions():
    found = excitation(np.array([[0.4, -0.6, 1.0]]), membership_functions=3)
    structure = model_structure(StructureSettings(consequents="seesaw", products="additive", membership_functions=3))
    features = np.concatenate([np.full(block.rules, block.features) for block in structure.blocks])
    np.testing.assert_allclose(found.determined @ features, 3.0)


def test_noise_leaves_fewer_directions_determined():
    """A direction counts where noise moves its coefficient by less than the inertia."""
    attitude = np.random.default_rng(16).uniform(-3.1, 3.1, (400, 3))
    quiet, loud, deafening = (excitation(attitude, noise, membership_functions=5) for noise in (0.01, 2.0, 1e6))
    assert quiet.excited.all()
    assert loud.determined.sum() < quiet.determined.sum()
    assert not deafening.excited.any()
    assert np.all(deafening.determined == 0)
