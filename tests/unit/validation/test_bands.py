"""The share of bootstrap draws that are a body wherever training was, beside matrices made one by one."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.dynamics import InertiaFunctions
from cpfls_cli.fuzzy.basis import InputRange
from cpfls_cli.regressor.regressor import uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.validation.bands import Draws, cell_centres, definite_share

RANGE = InputRange(-1.0, 1.0)
BODY = np.array([0.6, 0.8, 1.2, 0.05, 0.0, -0.03])


def model(visited):
    structure = model_structure(StructureSettings())
    parts = uniform_breakpoints(structure)
    return InertiaFunctions(structure, (RANGE, RANGE), parts, np.zeros(structure.parameters), BODY, visited)


def random_draws(own, size, count=60, seed=91):
    rng = np.random.default_rng(seed)
    rigid = BODY + 0.1 * rng.standard_normal((count, 6))
    return Draws(size * rng.standard_normal((count, len(own.coefficients))), rigid, rigid, 40, 1.0)


@pytest.mark.parametrize("at_once", [1_000_000, 100])
def test_share_of_draws_is_that_of_their_models(monkeypatch, at_once):
    monkeypatch.setattr("cpfls_cli.validation.bands._AT_ONCE", at_once)
    visited = np.zeros((72, 72), dtype=bool)
    visited[30:40, 30:40] = True
    own = model(visited)
    drawn = random_draws(own, 0.2)
    each = [
        np.linalg.eigvalsh(
            replace(own, coefficients=fuzzy, rigid_body=rigid).inertia(cell_centres(visited)).value
        ).min()
        > 0
        for fuzzy, rigid in zip(drawn.coefficients, drawn.rigid_body, strict=True)
    ]
    assert 0.1 < np.mean(each) < 0.9
    assert definite_share(own, drawn) == pytest.approx(np.mean(each))


def test_near_a_vertical_pitch_noise_says_nothing_of_a_body():
    """One row of cells there, at a pitch of 77.5 degrees, changes nothing; alone it leaves no share."""
    visited, near = np.zeros((2, 72, 72), dtype=bool)
    visited[30:40, 30:40] = near[:, 51] = True
    drawn = random_draws(model(visited), 0.2)
    assert definite_share(model(visited | near), drawn) == definite_share(model(visited), drawn) < 1
    assert definite_share(model(near), drawn) is None


def test_no_cell_was_visited():
    own = model(np.zeros((72, 72), dtype=bool))
    assert definite_share(own, random_draws(own, 0.05)) is None
