"""Presets of the search: what they fill in, and that a key that is given wins."""

import re
from dataclasses import asdict, fields
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from cpfls_cli.config.load import validate
from cpfls_cli.config.study import resolved
from cpfls_cli.errors import ConfigError
from cpfls_cli.evolution.settings import EvolutionSettings
from cpfls_cli.identification.settings import PRESETS

METHOD = Path(__file__).parents[3] / "docs/method.md"
ROW = re.compile(r"^\| `(\w+)` \| (\S+) \| (\S+) \|$", re.MULTILINE)
TABLE = METHOD.read_text(encoding="utf-8").partition("| key of `identification` |")[2].partition("\n\n")[0]
PAGE = {key: {"paper": paper, "fast": fast} for key, paper, fast in ROW.findall(TABLE)}
# A value of each key that is neither the paper's nor the default.
OTHER = {
    "population": 44,
    "generations": 7,
    "subpopulations": 2,
    "migration_rate": 0.11,
    "migration_interval": 3,
    "generation_gap": 0.5,
    "crossover_rate": 0.6,
    "insertion_rate": 0.4,
    "selective_pressure": 1.2,
    "mutated_individuals": 0.3,
    "mutated_bits": 0.02,
    "ranking": "pareto-count",
    "first_objective_weight": 4,
    "reinsertion": "fitness",
    "stall_generations": 9,
}


def identification(**keys):
    return validate({"identification": keys}, "study.yaml").identification


@pytest.mark.parametrize("preset", ["paper", "fast"])
def test_a_preset_gives_what_the_method_page_says(preset):
    """Section 7 of the page, where section 9 and Table 5 of the paper are read."""
    settings = asdict(identification(preset=preset))
    stated = {key: yaml.safe_load(row[preset]) for key, row in PAGE.items()}
    assert {key: settings[key] for key in stated} == stated


def test_the_page_names_every_key_of_the_paper():
    assert set(PAGE) == set(PRESETS["paper"])


@settings(deadline=None)
@given(st.sets(st.sampled_from(sorted(OTHER))))
def test_a_preset_fills_in_only_what_is_not_given(keys):
    chosen = {key: OTHER[key] for key in keys}
    filled = asdict(identification(preset="paper", **chosen))
    untouched = asdict(identification(**chosen))
    for key, value in filled.items():
        if key in chosen:
            assert value == chosen[key]
        elif key in PAGE:
            assert value == yaml.safe_load(PAGE[key]["paper"])
        elif key != "preset":
            assert value == untouched[key]


def test_the_other_values_would_be_noticed():
    for key, value in OTHER.items():
        assert value not in (yaml.safe_load(text) for text in PAGE[key].values())


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
