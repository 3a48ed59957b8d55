"""Structures to compare, and their cross-validation against refits of rows written out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from cpfls_cli.dynamics import rigid_columns
from cpfls_cli.identification.data import axis_scale
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings, ValidationSettings
from cpfls_cli.identification.solver import contiguous_blocks
from cpfls_cli.regressor.regressor import Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.validation.structures import RIGID_BODY_NAME, candidate_structures, compare_structures, structure_name
from tests.builders.flights import bent_torque, random_flight

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
    listed = candidate_structures(own)
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
    assert candidate_structures(IdentificationSettings()) == candidate_structures(StructureSettings())


def test_one_rule_of_harmonics_has_no_use_for_an_input_map():
    one_rule = [
        s for s in candidate_structures(StructureSettings()) if s.membership_functions == 1 and s.harmonic_order == 2
    ]
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


SAMPLES = 300
VALIDATION = ValidationSettings(folds=4)


def bending_flight(bent=0.0, noise=0.05, samples=SAMPLES):
    """Torque of a rigid body, or of one with 0.5 cos(roll) added to D22."""
    return random_flight(bent_torque(size=0.5 * bent), 11, samples, noise=noise)


def settings(base, **keys):
    return IdentificationSettings(**keys, base=base, validation=VALIDATION)


@pytest.mark.parametrize("every", [1, 2], ids=["all", "selection"])
def test_without_a_rigid_body_errors_are_those_of_refits(every):
    training = bending_flight()
    learned = training[::every]
    keys = {"harmonic_order": 1, "products": "additive"}
    compared = compare_structures(training, learned, settings("none", **keys))
    blocks = contiguous_blocks(training.time, learned.time, 4, IdentificationSettings().ridge.embargo_s)
    scale = 1 / axis_scale(learned)

    def errors(columns):
        found = []
        for judged, left_out in zip(blocks.validation, blocks.left_out, strict=True):
            part, rest = learned[np.flatnonzero(~left_out)], training[np.flatnonzero(judged)]
            A = columns(part.motion)
            x = linalg.lstsq(A.reshape(part.torque.size, -1), part.torque.ravel())[0]
            found.append(np.mean(((rest.torque - columns(rest.motion) @ x) * scale) ** 2))
        return np.mean(found), np.std(found, ddof=1) / 2

    def fuzzy(m):
        ranges = data_ranges(structure, training.motion.attitude)
        return Regressor(structure, m, ranges).matrix(uniform_breakpoints(structure))

    structure = model_structure(candidate_structures(settings("none", **keys))[0])
    own = int(np.flatnonzero(compared.own)[0])
    for place, columns in ((0, rigid_columns), (own, fuzzy)):
        assert (compared.error[place], compared.standard_error[place]) == pytest.approx(errors(columns), rel=1e-8)
    assert compared.name[0] == RIGID_BODY_NAME
    assert compared.parameters[[0, own]].tolist() == [0, structure.parameters]
    assert np.isinf(compared.ridge_weight[0])
    assert np.all(compared.ridge_weight[1:] == 0)


def test_over_a_rigid_body_it_is_the_ridge_curve_of_the_structure():
    training, chosen = bending_flight(bent=1.0), settings("rigid-body", harmonic_order=1)
    compared = compare_structures(training, training, chosen)
    with_folds = replace(chosen, ridge=replace(chosen.ridge, folds=4))
    evaluator = model_evaluator(training, training, with_folds)
    curve = evaluator.solver.curve(uniform_breakpoints(evaluator.structure))
    own = int(np.flatnonzero(compared.own)[0])
    assert compared.error[own] == pytest.approx(curve.error[curve.chosen])
    assert compared.standard_error[own] == pytest.approx(curve.standard_error[curve.chosen])
    assert compared.ridge_weight[own] == pytest.approx(curve.weight[curve.chosen])
    assert compared.error[0] == pytest.approx(curve.error[-1])


@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_what_the_flight_holds_decides(base):
    """A rigid vehicle leaves nothing to gain; one that bends does, for harmonics of one rule."""
    for bent in (0.0, 1.0):
        data = bending_flight(bent, samples=1500)
        compared = compare_structures(data, data, settings(base))
        best = int(np.argmin(compared.error))
        gain = compared.error[0] - compared.error[best]
        assert (gain > 3 * compared.standard_error[best]) == bool(bent)
        assert np.sum(compared.own) == 1
    assert compared.name[best].startswith("harmonic")


def test_structures_that_the_samples_cannot_tell_are_left_out():
    few = bending_flight(samples=60)
    compared = compare_structures(few, few, settings("none"))
    assert compared.name[0] == RIGID_BODY_NAME
    assert np.max(compared.parameters) <= 3 * 45
    assert np.isfinite(compared.error).all()
    data = bending_flight()
    shipped = compare_structures(data, data, settings("none", harmonic_order=8, membership_functions=9))
    assert not shipped.own.any()


@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_too_few_samples_for_the_folds_compare_nothing(base):
    few = bending_flight(samples=7)
    compared = compare_structures(few, few, settings(base))
    assert compared.name == ()
    assert all(len(values) == 0 for values in vars(compared).values())


def test_a_long_flight_is_compared_on_pieces_of_it():
    data = bending_flight(samples=4000)
    few = replace(settings("none"), validation=ValidationSettings(samples=400))
    pieces = (np.arange(20)[:, None] * 200 + np.arange(20)).ravel()
    whole, part = compare_structures(data, data, few), compare_structures(data[pieces], data[pieces], few)
    np.testing.assert_allclose(whole.error, part.error)
    assert whole.name == part.name
