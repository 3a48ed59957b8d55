"""A simulator of another team: what its origin states as hidden is named, with its numbers."""

import pytest


def test_nothing_hidden_is_no_gap(answer_of):
    answer = answer_of("rotorpy", "rotorpy", "none")
    assert answer["verdict"] == "NO_GAP"
    assert answer["effects"] == []


def test_a_mass_that_is_stated_wrong_is_all_that_is_named(answer_of, coefficients_of):
    answer = answer_of("rotorpy", "rotorpy", "none", options=("--set", "vehicle.mass_kg=0.65"))
    assert [effect["name"] for effect in answer["effects"]] == ["parameter_error"]
    assert answer["verdict"] == "NAMED"
    assert coefficients_of(answer, "parameter_error")["thrust_scale"]["value"] == pytest.approx(0.3, rel=0.01)


def test_an_offset_of_the_centre_of_mass_is_found_to_five_percent(answer_of, coefficients_of):
    answer = answer_of("rotorpy", "rotorpy", "com")
    assert [effect["name"] for effect in answer["effects"]] == ["com_offset"]
    found = coefficients_of(answer, "com_offset")
    assert found["c_x"]["value"] == pytest.approx(0.010, rel=0.05)
    assert found["c_y"]["value"] == pytest.approx(-0.006, rel=0.05)
    assert answer["gap_after"]["torque_n_m"][1] < 0.01 * answer["gap_before"]["torque_n_m"][1]


def test_aerodynamics_are_told_apart_by_the_forces_to_ten_percent(answer_of, coefficients_of):
    answer = answer_of("rotorpy", "rotorpy", "drag")
    stated = {
        ("rotor_drag", "k_d"): 1.19e-4,
        ("inflow", "k_z"): 2.32e-4,
        ("translational_lift", "k_h"): 3.39e-3,
        ("parasitic_drag", "c_x"): 0.005,
        ("parasitic_drag", "c_y"): 0.005,
        ("parasitic_drag", "c_z"): 0.010,
    }
    assert {effect["name"] for effect in answer["effects"]} == {effect for effect, _ in stated}
    for (effect, name), value in stated.items():
        assert coefficients_of(answer, effect)[name]["value"] == pytest.approx(value, rel=0.1)
