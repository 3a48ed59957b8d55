"""Structures to compare: near the own one, each once, all of them valid."""

import pytest

from cpfls_cli.identification import IdentificationSettings
from cpfls_cli.regressor import StructureSettings, model_structure
from cpfls_cli.validation.candidates import candidates, structure_name

OWN = [
    {},
    {"membership_functions": 3},
    {"consequents": "seesaw", "products": "additive", "membership_functions": 5, "input_map": "data-range"},
    {"consequents": "seesaw", "structure": "fls", "membership_functions": (1, 2, 3, 4, 3, 2)},
    {"harmonic_order": 8, "products": "additive"},
]


@pytest.mark.parametrize("keys", OWN)
def test_the_own_structure_comes_first_and_every_name_once(keys):
    own = StructureSettings(**keys)
    listed = candidates(own)
    assert listed[0] == own
    names = [structure_name(structure) for structure in listed]
    assert len(set(names)) == len(names)
    assert 5 <= len(names) <= 12
    assert {1, 3, 5}.issubset(structure.membership_functions for structure in listed)
    assert {"full-circle", "data-range"} == {structure.input_map for structure in listed}
    harmonic = {structure.harmonic_order for structure in listed if structure.consequents == "harmonic"}
    assert {1, 2, 3}.issubset(harmonic)
    assert any(structure.consequents == "seesaw" for structure in listed)
    assert all(model_structure(structure).parameters > 0 for structure in listed)


def test_settings_of_an_identification_are_a_structure_too():
    assert candidates(IdentificationSettings()) == candidates(StructureSettings())


def test_one_rule_of_harmonics_has_no_use_for_an_input_map():
    one_rule = [s for s in candidates(StructureSettings()) if s.membership_functions == 1 and s.harmonic_order == 2]
    assert len(one_rule) == 1


@pytest.mark.parametrize(
    ("keys", "name"),
    [
        (OWN[0], "harmonic 2 tensor, 1 function, full-circle"),
        (OWN[2], "seesaw additive, 5 functions, data-range"),
        (OWN[3], "seesaw tensor, 1-2-3-4-3-2 functions, full-circle, classic"),
    ],
)
def test_names(keys, name):
    assert structure_name(StructureSettings(**keys)) == name
