"""Chromosomes, and the refinement of partition weights: its Jacobian, and what it does to a chromosome."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.dynamics import rigid_columns
from cpfls_cli.identification.evaluator import LARGEST_GENE, Problem, decode, encode, uniform_chromosome
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings
from cpfls_cli.regressor.regressor import RIGID, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from tests.builders.flights import random_flight, rigid_torque

STRUCTURE = model_structure(StructureSettings(membership_functions=(2, 3, 1, 5, 6, 7)))


def test_encode_rounds_and_clips_without_making_a_function_of_zero_width():
    genes = encode(np.array([-0.1, 0.0, 0.5, 1.0, 1.2, 1.6 / LARGEST_GENE]))
    assert genes.tolist() == [1, 1, 32768, 65535, 65535, 2]


def test_encoded_weights_decode_to_their_breakpoints():
    weights = np.random.default_rng(21).uniform(0.1, 1, STRUCTURE.genes)
    exact, rounded = (decode(STRUCTURE, w) for w in (weights, encode(weights).astype(float)))
    for b, b_rounded in zip(exact, rounded, strict=True):
        np.testing.assert_allclose(b_rounded, b, atol=1e-4)


def test_uniform_chromosome_is_equidistant():
    decoded = decode(STRUCTURE, uniform_chromosome(STRUCTURE).astype(float))
    for b, uniform in zip(decoded, uniform_breakpoints(STRUCTURE), strict=True):
        np.testing.assert_allclose(b, uniform, atol=1e-15)


def test_only_the_all_zero_partition_is_undefined():
    weights = np.ones(STRUCTURE.genes)
    weights[1:3] = 0
    finite = [bool(np.isfinite(b).all()) for b in decode(STRUCTURE, weights)]
    assert finite == [True, False, True, True, True, True]


STRUCTURES = {
    "seesaw": {"consequents": "seesaw", "products": "additive", "membership_functions": (3, 4, 2, 3, 3, 4)},
    "harmonic": {"harmonic_order": 1, "products": "additive", "membership_functions": 3},
}
STEP = 1e-6


def problem(structure, base, samples=120):
    """Noisy torque of a rigid body and of an inertia that depends on roll in a way no rigid body's does."""
    rng = np.random.default_rng(14)

    def torque_of(motion):
        torque = rigid_torque(np.diag([0.5, 0.7, 1.1]))(motion)
        torque[:, 1] += np.exp(np.cos(motion.attitude[:, 0])) * motion.acceleration[:, 1]
        return torque

    data = random_flight(torque_of, rng, samples, noise=0.05)
    off = LocalSearchSettings(enabled=False)
    settings = IdentificationSettings(**STRUCTURES[structure], base=base, local_search=off)
    return model_evaluator(data, data, settings), rng


def local_problem(evaluator, rng):
    """The problem of refining random genes, and these: the fit at the start gives its ridge and column sizes."""
    genes = encode(rng.uniform(0.3, 0.9, evaluator.structure.genes))
    return Problem(evaluator.solver, evaluator.fit(genes)), genes


def point_at(problem, weights):
    """Weights between the genes, which `Point` holds as they are."""
    genes = LARGEST_GENE * weights
    return problem.point(genes, problem.solver.products(decode(problem.solver.learned.structure, genes)))


def written_out(evaluator, start):
    """All rows of the least-squares problem at given weights, those of the ridge below them."""
    data, structure = evaluator.judge.ready.source, evaluator.structure
    regressor = Regressor(structure, data.motion, data_ranges(structure, data.motion.attitude))
    ridge = np.sqrt(start.ridge_weight * data.torque.size) * np.eye(structure.parameters)

    def rows(weights):
        A = regressor.matrix(decode(structure, weights)) / start.column_size
        if evaluator.cross_validated:
            A = np.concatenate([rigid_columns(data.motion), A], axis=2)
        A = (A * start.row_scale[:, None]).reshape(data.torque.size, -1)
        y = (data.torque * start.row_scale).ravel()
        if not evaluator.cross_validated:
            return A, y
        return np.vstack([A, np.pad(ridge, ((0, 0), (RIGID, 0)))]), np.append(y, np.zeros(structure.parameters))

    return rows


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_gradient_of_the_reduced_cost(structure, base):
    evaluator, rng = problem(structure, base)
    local, genes = local_problem(evaluator, rng)
    weights = genes / LARGEST_GENE
    assert np.isfinite(local.start.ridge_weight)
    gradient = local.linearised(point_at(local, weights))[1]
    cost = [[0.5 * point_at(local, weights + s * STEP * unit).square for s in (1, -1)] for unit in np.eye(len(weights))]
    expected = np.subtract(*np.transpose(cost)) / (2 * STEP)
    np.testing.assert_allclose(gradient, expected, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_jacobian_is_that_of_the_residual_beside_what_the_regressor_spans(structure, base):
    """Kaufman's approximation leaves out only the part inside the span, which the coefficients follow."""
    evaluator, rng = problem(structure, base)
    local, genes = local_problem(evaluator, rng)
    weights, rows = genes / LARGEST_GENE, written_out(evaluator, local.start)

    def beside(weights):
        A, y = rows(weights)
        return y - A @ np.linalg.lstsq(A, y, rcond=1e-10)[0]

    by_weight = np.transpose(
        [(beside(weights + STEP * unit) - beside(weights - STEP * unit)) / (2 * STEP) for unit in np.eye(len(weights))]
    )
    A, _ = rows(weights)
    expected = by_weight - A @ np.linalg.lstsq(A, by_weight, rcond=1e-10)[0]
    point = point_at(local, weights)
    normal, slope = local.linearised(point)
    square = expected.T @ expected
    np.testing.assert_allclose(normal, square, atol=1e-5 * np.abs(square).max())
    gradient = expected.T @ beside(weights)
    np.testing.assert_allclose(slope, gradient, atol=1e-5 * np.abs(gradient).max())
    assert point.square == pytest.approx(np.sum(beside(weights) ** 2), rel=1e-9)


@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_never_a_worse_chromosome(base):
    evaluator, rng = problem("seesaw", base)
    chromosomes = rng.integers(0, LARGEST_GENE + 1, (12, evaluator.structure.genes))
    chromosomes[0] = 0
    chromosomes[1, 2:5] = 0
    chromosomes[2, ::2] = 0
    refining = replace(evaluator, local_search=LocalSearchSettings(evaluations=6))
    plain, refined = evaluator(chromosomes), refining(chromosomes)
    np.testing.assert_array_equal(plain.genes, chromosomes)
    usable = np.isfinite(plain.objectives).all(axis=1)
    assert np.all(refined.objectives[usable, 0] <= plain.objectives[usable, 0])
    better = refined.objectives[usable, 0] < plain.objectives[usable, 0]
    # The rigid-body base is judged by cross-validation, which not every smaller training error improves.
    assert better.sum() > 3
    np.testing.assert_array_equal(evaluator(refined.genes).objectives, refined.objectives)


def test_undefined_chromosomes_get_the_worst_objectives():
    evaluator, _ = problem("seesaw", "none")
    structure = evaluator.structure
    chromosomes = np.array([np.zeros(structure.genes, dtype=np.int64), uniform_chromosome(structure)])
    evaluated = replace(evaluator, local_search=LocalSearchSettings())(chromosomes)
    np.testing.assert_array_equal(evaluated.objectives[0], [np.inf] * 3)
    np.testing.assert_array_equal(evaluated.genes[0], chromosomes[0])
    assert np.isfinite(evaluated.objectives[1]).all()


def test_objectives_are_those_of_a_plain_least_squares_fit():
    evaluator, rng = problem("seesaw", "none")
    chromosome = rng.integers(20000, LARGEST_GENE, evaluator.structure.genes)
    evaluated = evaluator(chromosome[None])
    Q, torque = written_out(evaluator, evaluator.fit(chromosome))(chromosome.astype(float))
    error = torque - Q @ (np.linalg.pinv(Q, rcond=1e-10) @ torque)
    singular = np.linalg.svd(Q, compute_uv=False)
    singular = singular[singular > 1e-10 * singular[0]]
    expected = [np.mean(error**2), np.abs(error).max(), singular[0] / singular[-1]]
    np.testing.assert_allclose(evaluated.objectives[0], expected, rtol=1e-7)
