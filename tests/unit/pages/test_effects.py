"""Effects in words: digits that tell, and nothing rounded into certainty."""

from dataclasses import replace

import numpy as np

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.pages.gap import effect_title
from cpfls_cli.report.content import Table, unfolded
from tests.builders import gap_artifacts as made

OFFSET = made.named_effect(
    "com_offset",
    linear=[0.01],
    numbers=(Estimate("c_x", "m", 0.0100000015, 0.0099995, 0.0100012, (-0.1, 0.1)),),
    p_value=1e-9,
    share=0.998,
    sentence="Off centre.",
)


def closest_sentence(effect):
    box, *_ = made.blocks_of(replace(made.diagnosis("UNEXPLAINED", named=()), closest=(effect,)), "diagnose")
    return box.sentences[0]


def named_sentences(effects):
    box, *_ = made.blocks_of(replace(made.diagnosis(), effects=tuple(effects)), "diagnose")
    return box.sentences


def effect_sentence(effect):
    return named_sentences([effect])[0]


def tables(found):
    return [each for each in unfolded(made.blocks_of(found, "diagnose")) if isinstance(each, Table)]


def test_every_effect_has_a_title():
    assert all(effect_title(name) == entry.title for name, entry in CATALOGUE.items())
    assert effect_title("of_another_version") == "of another version"


def test_ends_of_an_interval_can_be_told_apart_and_rounding_makes_no_certainty():
    assert effect_sentence(OFFSET) == (
        "Offset of the centre of mass (com_offset): c_x = 0.01000000 [0.00999950, 0.01000120] m (p < 10⁻⁶, more than "
        "99 % of the gap)."
    )
    assert "less than 1 % of" in effect_sentence(replace(OFFSET, share=-0.001))
    assert "(p = 0.012, " in effect_sentence(replace(OFFSET, p_value=0.0123))
    assert closest_sentence(OFFSET).startswith(
        "The closest was offset of the centre of mass, which does not explain the gap: "
    )
    # Of an effect that is not the answer the share is none of the gap.
    assert closest_sentence(OFFSET).endswith("(p < 10⁻⁶, more than 99 % of what the closest effects explain).")


def test_shares_of_effects_that_overlap_are_what_returns_without_each():
    pair = [replace(OFFSET, share=0.7), replace(OFFSET, share=0.6)]
    assert named_sentences(pair)[1].endswith("(p < 10⁻⁶, 60 % of the gap returns without it).")
    apart = [replace(OFFSET, share=0.7), replace(OFFSET, share=0.3)]
    assert named_sentences(apart)[1].endswith("(p < 10⁻⁶, 30 % of the gap).")


def test_a_power_of_ten_that_all_three_have_stands_once():
    torque = Estimate("M_x", "N m", 2e-6, -6.86e-5, 7.28e-5, (-1e-3, 1e-3))
    assert "M_x = 0.2 [−6.9, 7.3] × 10⁻⁵ N m (p" in effect_sentence(replace(OFFSET, numbers=(torque,)))
    alone = Estimate("M_x", "N m", 2e-6, np.nan, np.nan, (-1e-3, 1e-3))
    assert "M_x = 2 × 10⁻⁶ [—, —] N m (p" in effect_sentence(replace(OFFSET, numbers=(alone,)))


def test_a_wrong_thrust_is_not_said_to_be_a_wrong_inertia_too():
    """Rates show inertia over rotor torque, so that of a thrust 17 % less every moment of inertia seems 20 % more."""

    def headline(inertia, half):
        numbers = [Estimate("inertia_x", "1", inertia, inertia - half, inertia + half, (-1, 3))]
        numbers.append(Estimate("thrust_scale", "1", -0.17, -0.175, -0.165, (-1, 3)))
        effect = made.named_effect("parameter_error", numbers=tuple(numbers))
        box, *_ = made.blocks_of(replace(made.diagnosis(), effects=(effect,)), "diagnose")
        return box.title

    assert headline(0.2, 0.01) == (
        "A parameter of the vehicle is wrong: thrust −17.00 % (as the ratio of Ixx to the rotor torque shows too) "
        "against the config."
    )
    assert headline(0.3, 0.01).startswith("Parameters of the vehicle are wrong: Ixx +30.0 % and thrust −17.0")


def test_errors_of_the_vehicles_numbers_are_per_cent_with_a_sign():
    def said(name, *number, effect="parameter_error"):
        numbers = (Estimate(name, "1", *number, (-0.9, 3.0)),)
        return effect_sentence(replace(OFFSET, name=effect, numbers=numbers))

    assert "(parameter_error): Izz over yaw torque +24.0 % [+19.9, +28.1] (p" in said("inertia_z", 0.24, 0.199, 0.281)
    assert "Ixx −8 % [−20, +4] (p" in said("inertia_x", -0.08, -0.2, 0.04)
    assert ": drag factor +20.1 % [+18.0, +22.2] (p" in said("error", 0.201, 0.18, 0.222, effect="drag_factor_error")
    assert "thrust −9.00 % [−9.11, −8.89] (p" in said("thrust_scale", -0.09, -0.0911, -0.0889)


def test_an_effect_stands_once_beside_its_coefficients():
    found = made.diagnosis(named=({}, {"name": "wind"}))
    (table,) = [each for each in tables(found) if each.header[:2] == ["Effect", "Coefficient"]]
    assert [row[0].text for row in table.cells] == ["com_offset", "wind"]


def test_sets_stand_in_a_table_with_how_likely_each_is():
    found = made.diagnosis(sets=[(("com_offset", "motor_lag"), 0.954), (("torque_bias", "motor_lag"), 0.046)])
    (table,) = [each for each in tables(found) if each.header[0] == "Set of effects"]
    assert [[cell.text for cell in row] for row in table.cells] == [
        ["offset of the centre of mass and motor lag", "95 %"],
        ["constant torque and motor lag", "5 %"],
    ]
