"""A module exported from any structure computes what the library computes."""

import warnings

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from cpfls_cli.export.source import python_source
from tests.builders.exported_models import Case, errors, model_of, sheet_of, short_runs, states, wanted_of

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
    motion = states(model, 60, seed)
    names = {"__name__": "vehicle"}
    exec(python_source(sheet_of(model), "vehicle.py"), names)
    q, qd, qdd = motion.attitude, motion.rate, motion.acceleration
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torque, body = names["torque"](q, qd, qdd)
        found = {"D": names["inertia"](q), "C": names["coriolis"](q, qd), "torque": torque, "body": body}
    wanted = wanted_of(model, motion)
    assert max(errors(found, wanted).values()) < 1e-12, errors(found, wanted)
    assert np.array_equal(names["inside"](q), wanted.inside)
