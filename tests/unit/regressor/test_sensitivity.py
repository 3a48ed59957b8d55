"""Derivatives of the torque by breakpoints and by weights against finite differences."""

import numpy as np
import pytest

from cpfls_cli.identification.evaluator import decode, weight_jacobian
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import Regressor, data_ranges
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from tests.builders.torque_sensitivity import torque_sensitivity

SEESAW = {"consequents": "seesaw", "products": "additive"}
STRUCTURES = {
    "paper": {**SEESAW, "membership_functions": 5},
    "paper-data-range": {**SEESAW, "membership_functions": 5, "input_map": "data-range"},
    "classic": {**SEESAW, "membership_functions": 3, "structure": "fls"},
    "unequal": {**SEESAW, "membership_functions": (1, 2, 3, 5, 7, 4)},
    "harmonic": {"harmonic_order": 2, "products": "tensor", "membership_functions": (3, 4, 2, 3, 5, 1)},
}
STEP = 1e-7


@pytest.fixture(params=STRUCTURES)
def problem(request):
    structure = model_structure(StructureSettings(**STRUCTURES[request.param]))
    rng = np.random.default_rng(10)
    attitude = rng.uniform(-np.pi, np.pi, (60, 3))
    motion = Motion(attitude, rng.standard_normal((60, 3)), rng.standard_normal((60, 3)))
    regressor = Regressor(structure, motion, data_ranges(structure, attitude))
    return regressor, rng.uniform(0.5, 1.5, structure.genes), rng.standard_normal(structure.parameters)


def test_torque_sensitivity(problem):
    regressor, weights, coefficients = problem
    partitions = decode(regressor.structure, weights)
    sensitivity = torque_sensitivity(regressor, partitions, coefficients)
    assert [s.shape[2] for s in sensitivity] == [max(len(b) - 2, 0) for b in partitions]
    for index, by_breakpoint in enumerate(sensitivity):
        for inner in range(by_breakpoint.shape[2]):
            moved = [[b.copy() for b in partitions] for _ in range(2)]
            moved[0][index][inner + 1] += STEP
            moved[1][index][inner + 1] -= STEP
            ahead, behind = (regressor.matrix(b) @ coefficients for b in moved)
            scale = np.abs(by_breakpoint).max()
            assert scale > 0
            np.testing.assert_allclose(
                by_breakpoint[:, :, inner], (ahead - behind) / (2 * STEP), atol=1e-6 * max(scale, 1)
            )


def test_weight_jacobian(problem):
    regressor, weights, coefficients = problem
    structure = regressor.structure
    moved = torque_sensitivity(regressor, decode(structure, weights), coefficients)
    jacobian = np.concatenate(moved, axis=2) @ weight_jacobian(structure, weights)
    assert jacobian.shape == (60, 3, structure.genes)
    for gene in range(structure.genes):
        ahead, behind = (
            regressor.matrix(decode(structure, weights + s * STEP * (np.arange(structure.genes) == gene)))
            @ coefficients
            for s in (1, -1)
        )
        np.testing.assert_allclose(
            jacobian[:, :, gene], (ahead - behind) / (2 * STEP), atol=1e-6 * np.abs(jacobian).max()
        )
