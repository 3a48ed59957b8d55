"""Evaluators of chromosomes against a slow reference."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cpfls_cli.dynamics import newton_euler_torque, rigid_columns
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import (
    LARGEST_GENE,
    Problem,
    decode,
    encode,
    refine,
    stepped,
    uniform_chromosome,
)
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings
from cpfls_cli.least_squares import SMALLEST_SINGULAR_SHARE
from cpfls_cli.regressor.regressor import RIGID, Motion, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.trajectory.planning import plan
from cpfls_cli.trajectory.settings import TrajectorySettings
from tests.builders.flights import random_flight, rigid_torque
from tests.builders.reference_evaluator import ReferenceEvaluator

PAPER = {"base": "none", "consequents": "seesaw", "products": "additive", "input_map": "data-range"}
OFF = LocalSearchSettings(enabled=False)
WELL_CONDITIONED = 1e6
STRUCTURE = model_structure(StructureSettings(membership_functions=(2, 3, 1, 5, 6, 7)))


@cache
def cube_diagonal():
    """The paper's path and the torque of its vehicle, 1524 samples."""
    path = plan(TrajectorySettings(sample_time_s=0.036), 9.81)
    motion = Motion(path.attitude, path.attitude_rate, path.attitude_acceleration)
    torque = newton_euler_torque(motion.attitude, motion.rate, motion.acceleration, np.diag([0.6, 0.6, 1.2]))
    return TorqueData(path.time, motion, torque)


def evaluators(training, learned, **settings):
    """The fast evaluator and the plain one."""
    settings = IdentificationSettings(**{**PAPER, "local_search": OFF, **settings})
    return model_evaluator(training, learned, settings), ReferenceEvaluator(training, learned, settings)


def chromosomes(structure, count, seed):
    """Half of them anywhere, half without very narrow functions, and one with functions of zero width."""
    rng = np.random.default_rng(seed)
    genes = rng.integers(0, LARGEST_GENE + 1, (count, structure.genes))
    genes[count // 2 :] = rng.integers(20000, LARGEST_GENE + 1, (count - count // 2, structure.genes))
    for part in structure.weight_slices():
        genes[0, part][:-1] = 0
    return genes


@pytest.mark.parametrize(
    ("settings", "every", "learned"),
    [
        ({"membership_functions": 5}, 1, 1),
        ({"membership_functions": 5}, 2, 3),
        ({"membership_functions": (3, 3, 2, 3, 2, 2), "structure": "fls"}, 3, 1),
        ({"membership_functions": (1, 2, 3, 4, 3, 2)}, 3, 2),
    ],
)
def test_objectives_are_those_of_the_plain_evaluator(settings, every, learned):
    """Equal where the condition number is below 1e6, and above it worse than all of those."""
    data = cube_diagonal()[::every]
    fast, plain = evaluators(data, data[::learned], **settings)
    genes = chromosomes(fast.structure, 36, 33)
    found, expected = fast(genes), plain(genes)
    np.testing.assert_array_equal(found.genes, genes)
    well = expected.objectives[:, 2] < WELL_CONDITIONED
    assert well.sum() >= 10
    np.testing.assert_allclose(found.objectives[well], expected.objectives[well], rtol=1e-9)
    assert np.isfinite(found.objectives[~well]).all()
    assert np.min(found.objectives[~well, 2], initial=np.inf) > np.max(found.objectives[well, 2])


def test_more_dependent_columns_are_never_better():
    """Where columns are dependent, the fast evaluator counts no fewer of them, and no error below the smallest."""
    data = cube_diagonal()[::6]
    fast, plain = evaluators(data, data, membership_functions=5, rank_tolerance=1e-10)
    genes = np.random.default_rng(34).integers(0, LARGEST_GENE + 1, (80, fast.structure.genes))
    found, expected = fast(genes).objectives, plain(genes).objectives
    counted, dependent = (
        np.where(objectives[:, 2] * tolerance > 1.5, np.round(objectives[:, 2] * tolerance - 1), 0)
        for objectives, tolerance in ((found, SMALLEST_SINGULAR_SHARE), (expected, 1e-10))
    )
    assert len(np.unique(dependent)) > 3
    assert np.all(counted >= dependent)
    same = counted == dependent
    assert same.sum() > 40
    assert np.all(np.diff(found[same, 2][np.lexsort((expected[same, 2], dependent[same]))]) >= 0)
    assert np.all(found[:, 0] >= expected[:, 0] * (1 - 1e-6))
    np.testing.assert_allclose(found[same, :2], expected[same, :2], rtol=1e-6)


def test_both_refuse_the_same_chromosomes():
    data = cube_diagonal()[::8]
    fast, plain = evaluators(data, data, membership_functions=4)
    genes = np.random.default_rng(35).integers(1, LARGEST_GENE + 1, (4, fast.structure.genes))
    genes[1], genes[2, 3:6] = 0, 0
    defined = [True, False, False, True]
    for evaluator in (fast, plain):
        np.testing.assert_array_equal(np.isfinite(evaluator(genes).objectives), np.transpose([defined] * 3))
        assert [evaluator.fit(chromosome) is not None for chromosome in genes] == defined


def test_fit_is_that_of_the_plain_evaluator():
    data = cube_diagonal()
    fast, plain = evaluators(data, data[::2], membership_functions=3)
    chromosome = np.random.default_rng(36).integers(1, LARGEST_GENE + 1, fast.structure.genes)
    found, expected = (evaluator.fit(chromosome) for evaluator in (fast, plain))
    np.testing.assert_allclose(found.coefficients, expected.coefficients, rtol=0, atol=1e-6)
    assert found.mean_squared_error == pytest.approx(expected.mean_squared_error, rel=1e-6)
    assert found.conditioning == pytest.approx(expected.conditioning, rel=1e-6)


def test_local_search_leaves_no_more_than_differences_through_the_whole_solve_do():
    """From the same starts, at the default budget; where a surface has many minima, no method is better from each."""
    data = cube_diagonal()[::8]
    fast, plain = evaluators(data, data, membership_functions=3, local_search=LocalSearchSettings())
    genes = np.random.default_rng(37).integers(0, LARGEST_GENE + 1, (12, fast.structure.genes))
    unrefined = evaluators(data, data, membership_functions=3)[0](genes).objectives[:, 0]
    found, expected = fast(genes).objectives[:, 0], plain(genes).objectives[:, 0]
    assert np.all(expected < unrefined)
    assert np.all(found < unrefined)
    assert np.mean(np.log(found / expected)) <= 1e-6
    assert np.mean(found <= expected * (1 + 1e-6)) >= 0.75


def test_what_a_local_search_found_is_written_back_where_it_is_better_or_always():
    """Learned on few samples, it can be worse on all."""
    data = cube_diagonal()[::2]
    plain = evaluators(data, data[::12], membership_functions=3)[0]
    genes = np.random.default_rng(38).integers(0, LARGEST_GENE + 1, (12, plain.structure.genes))
    unrefined = plain(genes)
    improved, always = (
        evaluators(data, data[::12], membership_functions=3, local_search=LocalSearchSettings(reinsert=kind))[0](genes)
        for kind in ("improved", "always")
    )
    assert np.all(improved.objectives[:, 0] <= unrefined.objectives[:, 0])
    worse = always.objectives[:, 0] > unrefined.objectives[:, 0]
    assert worse.any()
    np.testing.assert_array_equal(improved.genes[worse], genes[worse])
    np.testing.assert_array_equal(improved.genes[~worse], always.genes[~worse])
    assert not np.any((always.genes == genes).all(axis=1))


def test_a_search_can_be_judged_on_what_it_learns_from():
    data, learned = cube_diagonal(), cube_diagonal()[::9]
    settings = {"input_map": "full-circle", "membership_functions": 3}
    on_these, on_all = (evaluators(data, learned, **settings, judged_on=kind)[0] for kind in ("learned", "training"))
    genes = chromosomes(on_these.structure, 6, 39)
    alone = evaluators(learned, learned, **settings)[0](genes).objectives
    np.testing.assert_array_equal(on_these(genes).objectives, alone)
    assert not np.any(on_all(genes).objectives[:, 0] == alone[:, 0])


@pytest.mark.parametrize("seed", range(4))
def test_local_search_ends_in_the_minimum_next_to_its_start(seed):
    """Near the partitions that made the torque both methods end in the same minimum."""
    rng = np.random.default_rng(seed)
    settings = {"input_map": "full-circle", "membership_functions": 4}
    structure = model_structure(IdentificationSettings(**{**PAPER, **settings}))
    attitude = rng.uniform(-np.pi, np.pi, (120, 3))
    motion = Motion(attitude, *rng.standard_normal((2, 120, 3)))
    weights = rng.uniform(0.3, 0.9, structure.genes)
    regressor = Regressor(structure, motion, data_ranges(structure, attitude))
    torque = regressor.torque(decode(structure, weights), rng.standard_normal(structure.parameters))
    data = TorqueData(0.01 * np.arange(120), motion, torque + 0.01 * rng.standard_normal(torque.shape))
    fast, plain = evaluators(data, data, **settings, local_search=LocalSearchSettings(evaluations=20))

    def fit(weights):
        return fast.solver.fit(decode(structure, weights))

    start = weights * rng.uniform(0.98, 1.02, structure.genes)
    genes = encode(start)
    problem = Problem(fast.solver, fit(genes.astype(float)))
    refined = refine(problem, genes, fast.solver.products(decode(structure, genes.astype(float))), 20)
    # One step more, which is not rounded to genes.
    last = stepped(refined.genes / LARGEST_GENE, *problem.linearised(refined), damping=1e-6)
    found = fit(last).mean_squared_error
    expected = fit(plain.refine(start)).mean_squared_error
    assert expected < 0.5 * fit(start).mean_squared_error
    assert found <= expected * (1 + 1e-6)


def test_encoded_weights_decode_to_their_breakpoints():
    genes = encode(np.array([-0.1, 0.0, 0.5, 1.0, 1.2, 1.6 / LARGEST_GENE]))
    assert genes.tolist() == [1, 1, 32768, 65535, 65535, 2]
    weights = np.random.default_rng(21).uniform(0.1, 1, STRUCTURE.genes)
    exact, rounded = (decode(STRUCTURE, w) for w in (weights, encode(weights).astype(float)))
    for b, b_rounded in zip(exact, rounded, strict=True):
        np.testing.assert_allclose(b_rounded, b, atol=1e-4)
    decoded = decode(STRUCTURE, uniform_chromosome(STRUCTURE).astype(float))
    for b, uniform in zip(decoded, uniform_breakpoints(STRUCTURE), strict=True):
        np.testing.assert_allclose(b, uniform, atol=1e-15)
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
def test_jacobian_is_that_of_the_residual_next_to_what_the_regressor_spans(structure, base):
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
