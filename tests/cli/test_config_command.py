"""`cpfls config`: the default is documented, and what is printed loads as the same study."""

import json

import pytest
import yaml

from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import SECTIONS, Study


def test_default_is_the_default_study(cpfls, tmp_path):
    path = tmp_path / "default.yaml"
    path.write_text(cpfls("config").stdout)
    assert load_study(path) == Study()


def test_shipped_configs_load_and_print_the_same_study(cpfls, configs, tmp_path):
    for config in configs:
        path = tmp_path / config.name
        path.write_text(cpfls("config", config).stdout)
        assert load_study(path) == load_study(config), config


def test_any_yaml_reader_reads_it_as_the_json_says(cpfls, configs):
    for config in configs:
        as_json = cpfls.told("config", config)
        assert yaml.safe_load(cpfls("config", config).stdout) == as_json


@pytest.mark.parametrize("section", SECTIONS)
def test_section(cpfls, study, section):
    printed = yaml.safe_load(cpfls("config", study, "--section", section).stdout)
    whole = cpfls.told("config", study)
    assert printed == {"seed": 1, section: whole[section]}


def test_single_key_and_several_sections(cpfls, study):
    words = ("config", study, "--section", "vehicle.mass_kg", "--section", "reduction", "--json")
    printed = json.loads(cpfls(*words).stdout)
    assert printed["vehicle"] == {"mass_kg": 6.0}
    assert set(printed) == {"seed", "vehicle", "reduction"}


def test_unknown_section(refuse, study):
    (line,) = refuse("config", study, "--section", "vehicl")
    assert line.startswith("--section vehicl: no such section or key; the sections are vehicle, ")


def test_overrides_need_a_config(refuse):
    (line,) = refuse("config", "--set", "seed=2")
    assert line == "--set seed=2: needs a CONFIG"


def test_overrides_show(cpfls, study):
    words = ("config", study, "--set", "vehicle.rotors.0.spin=-1", "--set", "reduction.criterion=A", "--seed", 9)
    shown = cpfls.told(*words)
    assert (shown["seed"], shown["reduction"]["criterion"]) == (9, "A")
    assert [rotor["spin"] for rotor in shown["vehicle"]["rotors"]] == [-1, -1, 1, -1]
