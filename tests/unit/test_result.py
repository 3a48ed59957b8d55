"""Results that describe themselves."""

import json

import numpy as np
import pytest

from cpfls_cli.result import Estimate, column, datasets, described_fields, plain
from tests.builders.results import Craft, Curve, Rotor, craft, estimate


def test_it_is_frozen_and_takes_its_fields_by_keyword():
    with pytest.raises(AttributeError):
        craft().mass = 3.0
    with pytest.raises(TypeError):
        Estimate(1.0, 0.0, 2.0)


def test_json_holds_what_is_brief_and_what_is_shown():
    told = plain(craft(mass=2.5))
    assert told["heavy"] is True
    assert told["hover"] == {"value": None, "low": None, "high": None}
    assert told["rotors"][0]["share"] == {"value": 0.2, "low": -0.8, "high": 1.2}
    assert told["rotors"][0]["lag"] is None
    assert told["rotors"][1]["peaks"][0]["kinds"] == ["motor", "propeller"]
    assert list(told["curves"]) == ["yaw", "roll"]
    assert "gain" not in told["curves"]["roll"]
    assert json.loads(json.dumps(told, allow_nan=False)) == told


def test_fields_say_what_they_are():
    own = {each.name: each for each in described_fields(Craft)}
    assert own["battery"].optional
    assert own["battery"].kind is str
    assert own["kind"].scalar is str
    assert own["order"].scalar is int
    assert own["marked"].scalar is bool
    assert own["notes"].many
    assert (own["rotors"].table, own["rotors"].inner) == (True, Rotor)
    assert (own["curves"].named, own["curves"].inner) == (True, Curve)
    assert (own["hover"].inner, own["hover"].optional) == (Estimate, True)


def test_datasets_are_listed_by_path():
    paths = [path for path, _ in datasets(Craft)]
    assert {"mass", "hover/low", "rotors/peaks/frequency", "curves/*/gain"} <= set(paths)
    assert len(paths) == len(set(paths))


def test_a_column_of_a_table():
    assert column(craft().rotors, "name") == ["M1", "M2 ±|*x*"]
    assert np.isclose(estimate(3.0, 2.0).half, 2.0)
