"""Physical sense of models whose inertia is known, and errors one period away from the data."""

from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.dynamics.equations_of_motion import coriolis_matrix
from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
from cpfls_cli.dynamics.rigid_body import inertia_matrix
from cpfls_cli.fuzzy.inputs import InputRange
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import InertiaValues, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.validation.physical import energy_share, one_period_away, physical_sense
from tests.builders.flights import random_flight

RANGE = InputRange(-1.0, 1.0)
BODY = np.array([0.6, 0.8, 1.2, 0.05, 0.0, -0.03])


def model(rigid_body=BODY, visited=None, d11=0.0):
    structure = model_structure(StructureSettings())
    coefficients = np.zeros(structure.parameters)
    coefficients[0] = d11
    visited = np.ones((72, 72), dtype=bool) if visited is None else visited
    return InertiaFunctions(
        structure, (RANGE, RANGE), uniform_breakpoints(structure), coefficients, rigid_body, visited
    )


def examined(*args, **kwargs):
    return physical_sense(model(*args, **kwargs), np.random.default_rng(0))


def test_a_body_is_one_everywhere():
    """Two columns of cells around either vertical are left out; the smallest eigenvalue is the body's own there."""
    found = examined()
    assert (found.cells, found.indefinite) == (72 * 68, 0)
    edges = np.radians(np.arange(72) * 5 - 177.5)
    roll, pitch = np.meshgrid(edges, edges[np.abs(np.cos(edges)) > 0.1], indexing="ij")
    attitude = np.stack([roll.ravel(), pitch.ravel(), 0 * roll.ravel()], axis=1)
    smallest = np.linalg.eigvalsh(inertia_matrix(attitude, symmetric(BODY)))[:, 0]
    assert found.smallest_eigenvalue == pytest.approx(smallest.min())
    assert abs(np.cos(found.worst_attitude[1])) == pytest.approx(np.cos(np.radians(82.5)))


def test_a_negative_moment_is_found_where_training_was():
    visited = np.zeros((72, 72), dtype=bool)
    visited[36:40, 36] = True
    found = examined(visited=visited, d11=-0.7)
    assert (found.cells, found.indefinite) == (4, 4)
    assert found.smallest_eigenvalue == pytest.approx(-0.1, abs=0.02)
    assert np.radians(0) < found.worst_attitude[0] < np.radians(20)
    assert found.worst_attitude[1] == pytest.approx(np.radians(2.5))


def test_no_cell_was_visited():
    found = examined(visited=np.zeros((72, 72), dtype=bool))
    assert (found.cells, found.indefinite) == (0, 0)
    assert np.isnan(found.smallest_eigenvalue)


def test_a_coriolis_matrix_that_is_not_christoffel_s_makes_energy():
    """The derivative of D in place of C: the torque of a momentum that nobody balances."""
    rng = np.random.default_rng(1)
    gradient, rate = rng.standard_normal((5, 3, 3, 3)), rng.standard_normal((5, 3))
    values = InertiaValues(np.tile(np.eye(3), (5, 1, 1)), gradient + gradient.swapaxes(2, 3))
    assert energy_share(values, np.einsum("nkij,nk->nij", values.gradient, rate), rate) > 1e-2
    assert energy_share(values, coriolis_matrix(values, rate), rate) < 1e-14


def test_a_body_that_stands_still_makes_none():
    still = InertiaValues(np.eye(3)[None], np.zeros((1, 3, 3, 3)))
    assert energy_share(still, np.zeros((1, 3, 3)), np.zeros((1, 3))) == 0.0


def test_cells_that_training_did_not_visit_are_examined_too():
    """A D11 of -0.7 more is no body anywhere, wherever training was."""
    visited = np.zeros((72, 72), dtype=bool)
    visited[36, 36] = True
    found = examined(visited=visited, d11=-0.7)
    assert (found.indefinite_anywhere, found.every_cell) == (72 * 68, 72 * 68)
    assert examined(visited=visited).indefinite_anywhere == 0
    assert examined(visited=np.zeros((72, 72), dtype=bool), d11=-0.7).indefinite_anywhere == 72 * 68


def random_model(**settings):
    structure = model_structure(StructureSettings(**settings))
    coefficients = np.random.default_rng(91).standard_normal(structure.parameters)
    visited = np.ones((72, 72), dtype=bool)
    return InertiaFunctions(
        structure, (RANGE, RANGE), uniform_breakpoints(structure), coefficients, np.ones(6), visited
    )


def flight_of(torque_of, seed):
    return random_flight(torque_of, seed, 50, limit=3.0)


@pytest.mark.parametrize(
    "settings",
    [{}, {"consequents": "seesaw", "products": "additive", "membership_functions": 5}],
    ids=["ours", "paper"],
)
def test_a_periodic_model_errs_there_as_it_errs_here(settings):
    known = random_model(**settings)
    shifted = flight_of(lambda m: known.torque(m) + np.array([0.1, 0.0, -0.3]), 2)
    parts = {"one": flight_of(known.torque, 1), "other": shifted}
    found = one_period_away(known, parts)
    assert found.parts == ("one", "other")
    np.testing.assert_allclose(found.mse, [[0, 0, 0], [0.01, 0, 0.09]], atol=1e-9)
    np.testing.assert_allclose(found.max_error, [[0, 0, 0], [0.1, 0, 0.3]], atol=1e-9)


def test_the_worse_of_both_turns_is_told():
    """A random_model whose torque is the attitude itself: wrong by one turn about roll, or by one back about pitch."""
    straight = SimpleNamespace(
        structure=SimpleNamespace(settings=SimpleNamespace(input_map="full-circle")), torque=lambda m: m.attitude
    )
    found = one_period_away(straight, {"one": flight_of(lambda m: m.attitude, 3)})
    turn = 2 * np.pi
    np.testing.assert_allclose(found.max_error, [[turn, turn, 0]])
    np.testing.assert_allclose(found.mse, [[turn**2, turn**2, 0]])


def test_inputs_scaled_to_the_data_have_no_period():
    scaled = random_model(input_map="data-range")
    assert one_period_away(scaled, {"one": flight_of(scaled.torque, 4)}) is None
