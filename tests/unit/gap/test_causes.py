"""Wrong numbers of the vehicle are said where they are sure, matter, and nothing named accounts for them."""

import numpy as np
import pytest
from scipy.stats import norm

from cpfls_cli.gap.naming.causes import JudgedEffect, impossible_ratios, likely_sets, wrong_numbers
from cpfls_cli.gap.naming.estimate import Estimates
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.gap_artifacts import named_effect


def number(name, value, half):
    return Estimate(name, "1", value, value - half, value + half, (-0.9, 3.0))


def found(*numbers):
    return Estimates(np.zeros(0), (), numbers, ())


def named(name, *coefficients):
    return named_effect(name, numbers=coefficients, share=0.9)


SURE = number("inertia_x", 0.15, 0.02)


def result(*numbers, effects=(), share=0.5):
    known = {each.name: each.numbers for each in effects}
    effect = wrong_numbers(found(*numbers), known, np.broadcast_to(share, 6), VehicleSettings())
    return () if effect is None else tuple(each.name for each in effect.numbers)


def test_sure_numbers_are_said():
    assert result(SURE, number("inertia_y", -0.1, 0.02)) == ("inertia_x", "inertia_y")


@pytest.mark.parametrize(
    "quiet",
    [
        number("inertia_x", 0.15, 0.11),
        number("inertia_x", 0.015, 0.001),
        number("inertia_x", 0.3, np.inf),
        number("coupling_x", 0.5, 0.01),
    ],
    ids=["not sure", "does not matter", "not seen", "coupling"],
)
def test_others_are_not(quiet):
    assert result(quiet) == ()


def test_a_refit_that_takes_nothing_off_the_gap_shows_nothing():
    assert result(SURE, share=0.04) == ()


def test_the_channel_of_the_number_has_to_shrink():
    elsewhere, there = np.zeros(6), np.zeros(6)
    elsewhere[1:], there[0] = 0.9, 0.9
    assert result(SURE, share=elsewhere) == ()
    assert result(SURE, share=there) == ("inertia_x",)


def test_probability_is_that_of_a_normal_error_of_the_surest_number():
    effect = wrong_numbers(found(SURE, number("inertia_y", 0.05, 0.02)), {}, np.full(6, 0.5), VehicleSettings())
    assert effect.p_value == pytest.approx(2 * norm.sf(1.96 * 0.15 / 0.02))
    assert (effect.name, effect.share) == ("parameter_error", 0.5)


@pytest.mark.parametrize(
    ("effects", "expected"),
    [
        ([named("com_offset")], ("inertia_x",)),
        ([named("com_offset"), named("battery_sag"), named("ground_effect")], ()),
        ([named("rotor_mismatch", number("difference_1", -0.2, 0.01))], ()),
        ([named("rotor_mismatch", number("drag_imbalance", 0.2, 0.01))], ("inertia_x",)),
        ([named("payload")], ("inertia_x",)),
    ],
    ids=["offset", "three small ones", "weak rotor", "drag only", "load"],
)
def test_effects_that_change_the_number_account_for_it(effects, expected):
    assert result(SURE, effects=effects) == expected


def test_a_wrong_drag_factor_accounts_for_as_much_of_izz():
    wrong = named("drag_factor_error", number("error", 0.2, 0.04))
    small, large, other = (
        number(name, value, 0.02) for name, value in (("inertia_z", -0.15), ("inertia_z", -0.25), ("inertia_x", -0.15))
    )
    assert result(small, effects=(wrong,)) == ()
    assert result(large, effects=(wrong,)) == ("inertia_z",)
    assert result(other, effects=(wrong,)) == ("inertia_x",)


@pytest.mark.parametrize(("inertia", "said"), [(0.0, True), (1 / 0.9 - 1, False)])
def test_where_rates_show_a_wrong_thrust_too_it_is_no_mass(inertia, said):
    numbers = found(number("thrust_scale", -0.1, 0.001), number("inertia_x", inertia, 0.005))
    effect = wrong_numbers(numbers, {}, np.full(6, 0.5), VehicleSettings())
    assert ("A mass of" in effect.sentence) is said


def test_a_load_accounts_for_any_thrust():
    assert result(number("thrust_scale", 0.5, 0.01), effects=[named("payload")]) == ()


def test_numbers_that_no_vehicle_has_are_ratios_to_the_config():
    surely = Estimate("inertia_z", "1", 11.0, 10.999, 11.001, (-0.7, 2.0))
    assert impossible_ratios([surely, number("inertia_y", 0.1, 0.01)]) == {"inertia_z": 12.0}


def test_numbers_that_a_vehicle_can_have_are_not_impossible():
    assert impossible_ratios([number("inertia_x", 2.9, 0.2), number("coupling_x", 50.0, 0.01)]) == {}


def judged(name, odds):
    return JudgedEffect(named(name), (), odds)


def test_sets_are_listed_with_how_likely_they_are():
    """A set that two looks come to is one; what is hardly possible is not listed."""
    even, hardly = np.zeros(12), np.full(12, -9.0)
    looks = [
        judged("motor_lag", {("com_offset", "command_delay"): even, ("com_offset", "inflow"): hardly}),
        judged("com_offset", {("motor_lag", "torque_bias"): even - 0.1, ("command_delay", "com_offset"): even}),
    ]
    sets = likely_sets(looks)
    assert [set(each.effects) for each in sets] == [
        {"motor_lag", "com_offset"}, {"com_offset", "command_delay"}, {"motor_lag", "torque_bias"},
    ]  # fmt: skip
    assert sets[0].likely == sets[1].likely > sets[2].likely
    assert sum(each.likely for each in sets) == pytest.approx(1)
    assert likely_sets([]) == ()
