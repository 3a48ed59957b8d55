"""One period away from the data."""

from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.fuzzy.inputs import InputRange
from cpfls_cli.identification import Model, TorqueData
from cpfls_cli.regressor import Motion, StructureSettings, model_structure, uniform_breakpoints
from cpfls_cli.validation.period import one_period_away

RANGE = InputRange(-1.0, 1.0)


def model(**settings):
    structure = model_structure(StructureSettings(**settings))
    coefficients = np.random.default_rng(91).standard_normal(structure.parameters)
    visited = np.ones((72, 72), dtype=bool)
    return Model(structure, (RANGE, RANGE), uniform_breakpoints(structure), coefficients, np.ones(6), visited)


def flight(torque_of, seed, samples=50):
    rng = np.random.default_rng(seed)
    motion = Motion(rng.uniform(-3, 3, (samples, 3)), *rng.standard_normal((2, samples, 3)))
    return TorqueData(0.01 * np.arange(samples), motion, torque_of(motion))


@pytest.mark.parametrize(
    "settings",
    [{}, {"consequents": "seesaw", "products": "additive", "membership_functions": 5}],
    ids=["ours", "paper"],
)
def test_a_periodic_model_errs_there_as_it_errs_here(settings):
    known = model(**settings)
    parts = {"one": flight(known.torque, 1), "other": flight(lambda m: known.torque(m) + np.array([0.1, 0.0, -0.3]), 2)}
    found = one_period_away(known, parts)
    assert found.parts == ("one", "other")
    np.testing.assert_allclose(found.mse, [[0, 0, 0], [0.01, 0, 0.09]], atol=1e-9)
    np.testing.assert_allclose(found.max_error, [[0, 0, 0], [0.1, 0, 0.3]], atol=1e-9)


def test_the_worse_of_both_turns_is_told():
    """A model whose torque is the attitude itself: wrong by one turn about roll, or by one back about pitch."""
    straight = SimpleNamespace(
        structure=SimpleNamespace(settings=SimpleNamespace(input_map="full-circle")), torque=lambda m: m.attitude
    )
    found = one_period_away(straight, {"one": flight(lambda m: m.attitude, 3)})
    turn = 2 * np.pi
    np.testing.assert_allclose(found.max_error, [[turn, turn, 0]])
    np.testing.assert_allclose(found.mse, [[turn**2, turn**2, 0]])


def test_inputs_scaled_to_the_data_have_no_period():
    scaled = model(input_map="data-range")
    assert one_period_away(scaled, {"one": flight(scaled.torque, 4)}) is None
