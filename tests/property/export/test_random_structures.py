"""Functions exported from any structure compute what the library computes."""

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from cpfls_cli.export.source import python_source
from tests.builders.exported_models import CASES, Case, errors, model_of, sheet_of, short_runs, states, wanted_of
from tests.builders.exported_vehicles import on_numpy

functions = st.integers(1, 15)
structures = st.fixed_dictionaries(
    {
        "structure": st.sampled_from(["cpfls", "fls"]),
        "input_map": st.sampled_from(["full-circle", "data-range"]),
        "consequents": st.sampled_from(["seesaw", "harmonic"]),
        "harmonic_order": st.integers(1, 4),
        "products": st.sampled_from(["additive", "tensor"]),
        "membership_functions": st.one_of(st.integers(1, 7), st.tuples(*[functions] * 6)),
    }
).filter(lambda s: s["structure"] == "cpfls" or s["consequents"] == "seesaw")


@pytest.fixture(autouse=True, scope="module")
def untested():
    """No module tests itself here."""
    with short_runs():
        yield


@settings(max_examples=50, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(structures, st.booleans(), st.booleans(), st.booleans(), st.integers(0, 1000))
def test_any_structure(structure, rigid, zero_width, still, seed):
    model = model_of(Case(structure, rigid=rigid, zero_width=zero_width, still=still), seed)
    motion = states(model, 20, seed)
    found, wanted = evaluated(model, motion), wanted_of(model, motion)
    assert max(errors(found, wanted).values()) < 1e-12, errors(found, wanted)


@pytest.mark.parametrize("name", CASES)
def test_each_structure(name):
    model = model_of(CASES[name])
    motion = states(model, 80, seed=len(name))
    found, wanted = evaluated(model, motion), wanted_of(model, motion)
    assert max(errors(found, wanted).values()) < 1e-12, errors(found, wanted)


def evaluated(model, motion):
    """Evaluate the exported functions sample by sample."""
    text = python_source(sheet_of(model), "vehicle.py", "jax")
    names, rows = on_numpy(text), list(zip(*vars(motion).values(), strict=True))
    torque, body = np.array([names["torque"](*row) for row in rows]).swapaxes(0, 1)
    return {
        "D": np.array([names["inertia"](q) for q, _, _ in rows]),
        "C": np.array([names["coriolis"](q, qd) for q, qd, _ in rows]),
        "torque": torque,
        "body": body,
    }
