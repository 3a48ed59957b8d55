"""Overrides change the key that they name and nothing else."""

import pytest

from cpfls_cli.config.load import apply_override
from cpfls_cli.config.study import Study, resolved
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


def test_a_list_that_the_config_leaves_out_starts_from_the_default_unless_it_is_of_a_vehicle():
    data = {}
    apply_override(data, "trajectory.direction.2=0.5")
    assert data["trajectory"]["direction"] == [*resolved(Study())["trajectory"]["direction"][:2], 0.5]
    with pytest.raises(ConfigError, match="the config holds no list 'rotors', and there is no default for it"):
        apply_override({"vehicle": {"mass_kg": 0.03}}, "vehicle.rotors.2.spin=-1")


@pytest.mark.parametrize("override", ["", "=", "a", ".=1", "a.=1", ".a=1", "a..b=1"])
def test_malformed(override):
    with pytest.raises(ConfigError, match=r"write section\.key=value"):
        apply_override({}, override)
