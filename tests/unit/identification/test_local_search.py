"""Refinement of partition weights: its Jacobian, and what it does to a chromosome."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.identification import IdentificationSettings, TorqueData, local_search
from cpfls_cli.identification.chromosome import LARGEST_GENE, decode, uniform_chromosome
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.settings import LocalSearchSettings
from cpfls_cli.regressor import Motion
from cpfls_cli.vehicle import newton_euler_torque

STRUCTURES = {
    "seesaw": {"consequents": "seesaw", "products": "additive", "membership_functions": (3, 4, 2, 3, 3, 4)},
    "harmonic": {"harmonic_order": 1, "products": "additive", "membership_functions": 3},
}
STEP = 1e-6


def problem(structure, base, samples=120):
    """Noisy torque of a rigid body and of an inertia that depends on roll in a way no rigid body's does."""
    rng = np.random.default_rng(14)
    motion = Motion(rng.uniform(-np.pi, np.pi, (samples, 3)), *rng.standard_normal((2, samples, 3)))
    torque = newton_euler_torque(motion.attitude, motion.rate, motion.acceleration, np.diag([0.5, 0.7, 1.1]))
    torque[:, 1] += np.exp(np.cos(motion.attitude[:, 0])) * motion.acceleration[:, 1]
    torque += 0.05 * rng.standard_normal(torque.shape)
    data = TorqueData(0.01 * np.arange(samples), motion, torque)
    off = LocalSearchSettings(enabled=False)
    settings = IdentificationSettings(**STRUCTURES[structure], base=base, local_search=off)
    return model_evaluator(data, data, settings), rng


def captured(monkeypatch, solver, weights):
    """The residual and the Jacobian that the refinement hands to the optimiser."""
    handed = {}

    def optimiser(residual, start, jac, **_):
        handed.update(residual=residual, jacobian=jac)
        return SimpleNamespace(x=start)

    monkeypatch.setattr(local_search, "least_squares", optimiser)
    start = solver.fit(decode(solver.regressor.structure, weights))
    local_search.refine(solver, weights, start, 1)
    return handed["residual"], handed["jacobian"], start


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_gradient_of_the_reduced_cost(monkeypatch, structure, base):
    evaluator, rng = problem(structure, base)
    weights = rng.uniform(0.3, 0.9, evaluator.structure.genes)
    residual, jacobian, start = captured(monkeypatch, evaluator.solver, weights)
    assert np.isfinite(start.ridge_weight)
    gradient = jacobian(weights).T @ residual(weights)
    cost = [[0.5 * np.sum(residual(weights + s * STEP * unit) ** 2) for s in (1, -1)] for unit in np.eye(len(weights))]
    expected = np.subtract(*np.transpose(cost)) / (2 * STEP)
    np.testing.assert_allclose(gradient, expected, atol=1e-5 * np.abs(expected).max())


def test_jacobian_is_that_of_the_residual_beside_what_the_regressor_spans(monkeypatch):
    """Kaufman's approximation leaves out only the part inside the span, which the coefficients follow."""
    evaluator, rng = problem("seesaw", "none")
    regressor = evaluator.solver.regressor
    weights = rng.uniform(0.3, 0.9, regressor.structure.genes)
    residual, jacobian, _ = captured(monkeypatch, evaluator.solver, weights)
    by_weight = [
        (residual(weights + STEP * unit) - residual(weights - STEP * unit)) / (2 * STEP) for unit in np.eye(13)
    ]
    Q = regressor.matrix(decode(regressor.structure, weights)).reshape(360, -1)
    inside = Q @ np.linalg.pinv(Q, rcond=1e-10)
    expected = np.transpose(by_weight) - inside @ np.transpose(by_weight)
    np.testing.assert_allclose(jacobian(weights), expected, atol=1e-5 * np.abs(expected).max())


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
    solver = evaluator.solver
    regressor = solver.regressor
    chromosome = rng.integers(20000, LARGEST_GENE, regressor.structure.genes)
    evaluated = evaluator(chromosome[None])
    Q = regressor.matrix(decode(regressor.structure, chromosome.astype(float))).reshape(360, -1)
    error = solver.torque.ravel() - Q @ (np.linalg.pinv(Q, rcond=1e-10) @ solver.torque.ravel())
    singular = np.linalg.svd(Q, compute_uv=False)
    singular = singular[singular > 1e-10 * singular[0]]
    expected = [np.mean(error**2), np.abs(error).max(), singular[0] / singular[-1]]
    np.testing.assert_allclose(evaluated.objectives[0], expected, rtol=1e-7)
