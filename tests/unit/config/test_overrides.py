"""Overrides put a value where they say, and nothing else changes."""

import pytest

from cpfls_cli.config.overrides import apply_override
from cpfls_cli.errors import ConfigError


@pytest.mark.parametrize(
    ("data", "override", "result"),
    [
        ({}, "seed=3", {"seed": 3}),
        ({}, "vehicle.mass_kg=1e-3", {"vehicle": {"mass_kg": 0.001}}),
        ({"vehicle": None}, "vehicle.mass_kg=2", {"vehicle": {"mass_kg": 2}}),
        ({"vehicle": {"mass_kg": 1, "a": 5}}, "vehicle.mass_kg=2", {"vehicle": {"mass_kg": 2, "a": 5}}),
        ({"a": [1, 2]}, "a.1=7", {"a": [1, 7]}),
        ({"a": [{"b": 1}]}, "a.0.b=x", {"a": [{"b": "x"}]}),
        ({}, "report.title=a=b", {"report": {"title": "a=b"}}),
        ({}, "import.crop_s=[0, 1]", {"import": {"crop_s": [0, 1]}}),
        ({}, "vehicle.mass_kg=", {"vehicle": {"mass_kg": None}}),
    ],
)
def test_override(data, override, result):
    apply_override(data, override)
    assert data == result


def test_a_list_that_the_config_leaves_out_starts_from_the_default():
    data = {}
    apply_override(data, "vehicle.rotors.2.spin=-1")
    assert [rotor["spin"] for rotor in data["vehicle"]["rotors"]] == [1, -1, -1, -1]
    again = {}
    apply_override(again, "vehicle.rotors.0.spin=1")
    assert [rotor["spin"] for rotor in again["vehicle"]["rotors"]] == [1, -1, 1, -1]


@pytest.mark.parametrize("override", ["", "=", "a", ".=1", "a.=1", ".a=1", "a..b=1"])
def test_malformed(override):
    with pytest.raises(ConfigError, match=r"write section\.key=value"):
        apply_override({}, override)
