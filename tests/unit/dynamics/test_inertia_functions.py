"""Inertia and Coriolis matrix of a model: what any mechanical system owes."""

import numpy as np
import pytest

from cpfls_cli.dynamics import InertiaFunctions, coriolis_matrix, visited_cells
from cpfls_cli.identification.evaluator import decode
from cpfls_cli.regressor.regressor import Motion, data_ranges
from cpfls_cli.regressor.structure import StructureSettings, model_structure

STRUCTURES = {
    "seesaw": {"consequents": "seesaw", "products": "additive", "membership_functions": 5},
    "data-range": {
        "consequents": "seesaw",
        "products": "additive",
        "membership_functions": 3,
        "input_map": "data-range",
    },
    "classic": {"consequents": "seesaw", "products": "additive", "membership_functions": 3, "structure": "fls"},
    "harmonic": {"membership_functions": (1, 4, 2, 3, 5, 1)},
}


@pytest.fixture(params=STRUCTURES)
def case(request):
    """A model with random coefficients over a random rigid body, and a motion."""
    rng = np.random.default_rng(19)
    structure = model_structure(StructureSettings(**STRUCTURES[request.param]))
    attitude = rng.uniform(-np.pi, np.pi, (50, 3))
    model = InertiaFunctions(
        structure,
        data_ranges(structure, attitude),
        decode(structure, rng.uniform(1, 2, structure.genes)),
        rng.standard_normal(structure.parameters),
        rng.standard_normal(6),
        visited_cells([attitude]),
    )
    return model, Motion(attitude, *rng.standard_normal((2, 50, 3)))


def test_torque_is_inertial_plus_coriolis(case):
    model, motion = case
    inertial = np.einsum("nij,nj->ni", model.inertia(motion.attitude).value, motion.acceleration)
    coriolis = np.einsum("nij,nj->ni", coriolis_matrix(model.inertia(motion.attitude), motion.rate), motion.rate)
    np.testing.assert_allclose(inertial + coriolis, model.torque(motion), atol=1e-10)


def test_coriolis_forces_do_no_work_of_their_own(case):
    """qd^T (dJ/dt - 2 C) qd = 0; stronger, dJ/dt - 2 C is skew-symmetric."""
    model, motion = case
    inertia = model.inertia(motion.attitude)
    np.testing.assert_allclose(inertia.value, inertia.value.swapaxes(1, 2), atol=1e-14)
    change = np.einsum("nkij,nk->nij", inertia.gradient, motion.rate)
    skew = change - 2 * coriolis_matrix(inertia, motion.rate)
    np.testing.assert_allclose(skew + skew.swapaxes(1, 2), 0.0, atol=1e-11)
    assert np.abs(skew).max() > 0.1


def test_gradient_of_inertia(case):
    model, motion = case
    step = 1e-6
    for angle, unit in enumerate(np.eye(3)):
        ahead, behind = (model.inertia(motion.attitude + s * step * unit).value for s in (1, -1))
        gradient = model.inertia(motion.attitude).gradient[:, angle]
        np.testing.assert_allclose(gradient, (ahead - behind) / (2 * step), atol=1e-3)


def test_coriolis_matrix_by_the_sum_of_christoffel_symbols(case):
    model, motion = case
    inertia = model.inertia(motion.attitude)
    D, qd, n = inertia.gradient, motion.rate, 7
    expected = [
        [sum(0.5 * (D[n, k, i, j] + D[n, j, i, k] - D[n, i, j, k]) * qd[n, k] for k in range(3)) for j in range(3)]
        for i in range(3)
    ]
    np.testing.assert_allclose(coriolis_matrix(inertia, qd)[n], expected, atol=1e-12)


def test_long_motions_are_predicted_in_parts(case):
    model, motion = case
    many = np.arange(9000) % 50
    np.testing.assert_allclose(model.torque(motion[many]), model.torque(motion)[many], atol=1e-12)


def test_attitudes_outside_training_are_flagged(case):
    model, motion = case
    assert not model.outside(motion.attitude).any()
    assert model.outside(np.random.default_rng(20).uniform(-np.pi, np.pi, (500, 3))).any()


def test_one_rule_learned_all_round_the_circle_is_the_same_everywhere():
    circle = np.linspace(-np.pi, np.pi, 200)
    round_both = np.column_stack([circle, 2 * circle, 0 * circle])
    near_hover, round_roll = 0.1 * round_both, round_both * [1.0, 0.1, 1.0]

    def model(attitude, functions):
        structure = model_structure(StructureSettings(membership_functions=functions))
        partitions = decode(structure, np.ones(structure.genes))
        ranges, visited = data_ranges(structure, attitude), visited_cells([attitude])
        return InertiaFunctions(structure, ranges, partitions, np.zeros(structure.parameters), np.ones(6), visited)

    assert model(round_both, 1).same_everywhere
    assert model(round_both, 1).outside(np.array([[0.0, 2.0, 0.0]])).all()
    assert not model(round_both, 3).same_everywhere
    assert not model(near_hover, 1).same_everywhere
    assert not model(round_roll, 1).same_everywhere
