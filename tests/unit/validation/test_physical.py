"""Physical sense of models whose inertia is known."""

import numpy as np
import pytest

from cpfls_cli.dynamics import InertiaFunctions, inertia_matrix
from cpfls_cli.fuzzy.basis import InputRange
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.validation.bands import physical_sense

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
    return physical_sense(model(*args, **kwargs))


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


def test_cells_that_training_did_not_visit_are_examined_too():
    """A D11 of -0.7 more is no body anywhere, wherever training was."""
    visited = np.zeros((72, 72), dtype=bool)
    visited[36, 36] = True
    found = examined(visited=visited, d11=-0.7)
    assert (found.indefinite_anywhere, found.every_cell) == (72 * 68, 72 * 68)
    assert examined(visited=visited).indefinite_anywhere == 0
    assert examined(visited=np.zeros((72, 72), dtype=bool), d11=-0.7).indefinite_anywhere == 72 * 68
