"""Decoding all partitions at once, and the damped steps of the local search: bounds, budget, what it hands back."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from cpfls_cli.identification.evaluator import LARGEST_GENE, Problem, decode, refine, weight_jacobian
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.samples import Samples
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from tests.builders.flights import random_flight, rigid_torque


def one_by_one(weights):
    """Breakpoints of one partition as equation (10) has them, and their derivatives by the weights."""
    if len(weights) == 0:
        return np.zeros(1), np.zeros((0, 0))
    ends = np.concatenate([[0.0], np.cumsum(weights) / np.sum(weights)])
    ends[-1] = 1.0
    counted = np.tri(max(len(weights) - 1, 0), len(weights))
    return ends, (counted - ends[1:-1, None]) / np.sum(weights)


@pytest.mark.parametrize("functions", [1, 2, 5, 9, 15, (1, 2, 3, 4, 15, 2), (15, 14, 9, 2, 9, 3)])
def test_all_partitions_at_once_are_those_one_by_one_to_the_last_bit(functions):
    structure = model_structure(StructureSettings(membership_functions=functions))
    rng = np.random.default_rng(50)
    for scale in (1.0, 65535.0, 1e-3):
        weights = scale * rng.uniform(0, 1, structure.genes) ** 3
        ends, slopes = zip(*(one_by_one(weights[part]) for part in structure.weight_slices()), strict=True)
        for found, expected in zip(decode(structure, weights), ends, strict=True):
            np.testing.assert_array_equal(found, expected)
        np.testing.assert_array_equal(weight_jacobian(structure, weights), block_diag(*slopes))


@pytest.mark.parametrize("evaluations", [1, 2, 4])
@pytest.mark.parametrize("every", [1, 2])
def test_a_refinement_spends_its_budget_and_hands_back_the_products_of_its_genes(monkeypatch, evaluations, every):
    def torque(motion):
        whole = rigid_torque(np.diag([0.5, 0.7, 1.1]))(motion)
        whole[:, 1] += np.exp(np.cos(motion.attitude[:, 0])) * motion.acceleration[:, 1]
        return whole

    data = random_flight(torque, np.random.default_rng(14), 120, noise=0.05)
    settings = IdentificationSettings(
        base="none",
        consequents="seesaw",
        products="additive",
        membership_functions=3,
        local_search=LocalSearchSettings(),
    )
    evaluator = model_evaluator(data, data[::every], settings)
    genes = np.random.default_rng(51).integers(20000, LARGEST_GENE, evaluator.structure.genes)
    partitions = decode(evaluator.structure, genes.astype(float))
    products, calls = evaluator.solver.products(partitions), []
    problem = Problem(evaluator.solver, evaluator.solver.fit(partitions, products))
    counted = Samples.products
    monkeypatch.setattr(Samples, "products", lambda self, at: calls.append(at) or counted(self, at))
    found = refine(problem, genes, products, evaluations)
    assert len(calls) <= evaluations - 1
    again = evaluator.solver.products(decode(evaluator.structure, found.genes.astype(float)))
    np.testing.assert_array_equal(found.products.gram, again.gram)
    start = problem.point(genes, products).square
    assert found.square < start if evaluations > 1 else found.square == start
