"""Presets of the search: what they fill in, and that a key that is given wins."""

from dataclasses import asdict, fields

import pytest

from cpfls_cli.config.load import validate
from cpfls_cli.config.study import resolved
from cpfls_cli.errors import ConfigError
from cpfls_cli.evolution import EvolutionSettings
from cpfls_cli.identification.settings import PRESETS, IdentificationSettings

# Section 9 and Table 5 of the paper.
PAPER = {
    "population": 75,
    "generations": 25,
    "subpopulations": 5,
    "migration_rate": 0.2,
    "migration_interval": 5,
    "generation_gap": 0.8,
    "crossover_rate": 0.8,
    "recombination": "single-point",
    "insertion_rate": 0.8,
    "selective_pressure": 1.5,
    "mutated_individuals": 0.04,
    "mutated_bits": 0.01,
    "ranking": "quantity-dominance",
    "first_objective_weight": 1,
    "reinsertion": "uniform",
    "start": "random",
}


def identification(**keys):
    return validate({"identification": keys}, "study.yaml").identification


def test_the_paper_has_its_operators():
    settings = asdict(identification(preset="paper"))
    assert {key: settings[key] for key in PAPER} == PAPER


def test_a_key_that_is_given_wins_over_the_preset():
    settings = identification(preset="paper", generations=200, reinsertion="fitness")
    assert (settings.generations, settings.reinsertion) == (200, "fitness")
    assert settings.recombination == "single-point"


def test_without_a_preset_keys_have_their_defaults():
    assert identification() == identification(preset="fast") == IdentificationSettings()


def test_a_resolved_preset_reads_back_the_same():
    study = validate({"identification": {"preset": "paper", "population": 20}}, "study.yaml")
    assert validate(resolved(study), "study.yaml") == study


def test_the_paper_names_every_key_of_the_search():
    # How small an improvement counts is never asked where no search is stopped for it.
    assert {key.name for key in fields(EvolutionSettings)} - set(PRESETS["paper"]) == {"stall_improvement"}


@pytest.mark.parametrize("preset", ["papre", 3, None])
def test_an_unknown_preset_is_refused(preset):
    with pytest.raises(ConfigError, match=r"preset.*'fast' or 'paper'"):
        identification(preset=preset)


@pytest.mark.parametrize("section", [[], "fast"])
def test_a_section_that_is_no_mapping_is_told_as_before(section):
    with pytest.raises(ConfigError, match="must be a section of keys"):
        validate({"identification": section}, "study.yaml")


def test_a_setting_of_a_sweep_cannot_name_a_preset():
    settings = [{"name": "as in the paper", "set": {"identification.preset": "paper"}}]
    with pytest.raises(ConfigError, match=r'identification.preset = "paper": .*name the keys that differ'):
        validate({"sweep": {"settings": settings}}, "study.yaml", sweep=True)
