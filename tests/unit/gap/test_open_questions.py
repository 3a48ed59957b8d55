"""What stays open: effects that would not show, wrong numbers of the vehicle and their doubles, nameless torque."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from cpfls_cli import rotations
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.naming.causes import JudgedEffect, impossible_ratios, likely_sets, wrong_numbers
from cpfls_cli.gap.naming.estimate import Estimates, fitted
from cpfls_cli.gap.naming.open_questions import energy_directions, not_excited, not_separated
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.gap_artifacts import named_effect
from tests.builders.gap_flights import PERIOD, VEHICLE, candidate, fly, sines, weak

FLOOR = np.full(6, 0.05)
RNG = np.random.default_rng(1)
RATE = RNG.normal(size=(400, 3))
BLOCK = np.repeat(np.arange(10), 40)


def reasons(signals, chosen=(), floor=FLOOR):
    found = not_excited(system([weak(each) for each in signals], chosen), list(CATALOGUE.values()), floor)
    return {each.name: each.reason for each in found}


def test_a_rich_flight_hides_little_and_says_which_signals_it_lacks():
    found = reasons([fly(1, speed=5.0)])
    assert found["battery_sag"] == "the flights lack voltage"
    assert found["motor_lag"] == "rotor speeds are measured, so nothing between command and speed shows"
    for seen in ("com_offset", "rotor_drag", "linear_damping", "rotor_mismatch", "products_of_inertia", "wind"):
        assert seen not in found


def test_an_effect_can_show_where_one_flight_has_its_signal_and_is_not_high_above_the_ground():
    high, low = fly(1), replace(fly(1), ground_height_m=29.5)
    assert "heights" in reasons([high])["ground_effect"]
    assert "ground_effect" not in reasons([low])
    blind = replace(fly(2), velocity=None)
    assert "the flights lack velocity" in reasons([blind])["rotor_drag"]
    assert "rotor_drag" not in reasons([blind, fly(1, speed=5.0)])


def test_what_to_log_is_what_the_log_lacks():
    """Velocity and height along world axes say nothing without the attitude."""
    whole = fly(2)
    turned = replace(whole, attitude=None)
    assert reasons([turned])["rotor_drag"] == "the flights lack attitude"
    assert reasons([turned])["ground_effect"] == "the flights lack attitude"
    assert reasons([replace(turned, velocity=None)])["rotor_drag"] == "the flights lack attitude, velocity"
    assert reasons([replace(whole, position=None)])["ground_effect"] == "the flights lack height"


def test_hover_shows_a_bias_but_not_the_motion_that_is_missing():
    found = reasons([fly(1, tilt=1e-4, yaw=1e-4, speed=1e-3)])
    for hidden in ("linear_damping", "quadratic_damping", "products_of_inertia", "rotor_drag", "rotor_gyroscopic"):
        assert found[hidden].startswith("it would not show; ")
    assert "torque_bias" not in found


def test_what_is_chosen_is_not_unseen_and_more_noise_hides_more():
    found = reasons([fly(1, tilt=1e-4, yaw=1e-4, speed=1e-3)], [candidate("linear_damping")])
    assert "linear_damping" not in found
    assert "parameter_error" not in found
    quiet, loud = reasons([fly(1)], floor=0.1 * FLOOR), reasons([fly(1)], floor=100 * FLOOR)
    assert set(quiet) < set(loud)


def test_damping_drains_its_opposite_feeds_and_what_is_constant_or_noise_does_neither():
    torque = np.column_stack([-0.5 * RATE[:, 0], 0.5 * RATE[:, 1], np.zeros(400)]) + RNG.normal(size=(400, 3))
    assert energy_directions(torque, RATE, BLOCK) == ["drains", "feeds", "neither"]
    assert energy_directions(np.ones((400, 3)), RATE + 1, BLOCK) == ["neither"] * 3
    assert energy_directions(-RATE, RATE, BLOCK // 4) == ["neither"] * 3
    found = [energy_directions(RNG.normal(size=(400, 3)), RATE, BLOCK) for _ in range(100)]
    assert sum(word != "neither" for words in found for word in words) < 15


def carried(size, share, highest_hz):
    """A flight that leans for its acceleration, of `size` m/s^2, whose rotors pull by a share too much."""
    rng = np.random.default_rng(1)
    time = PERIOD * np.arange(3000)
    acceleration, _, _ = sines(time, [size, size, 0.5 * size], 0.2, highest_hz, rng)
    felt = acceleration + np.array([0.0, 0.0, 9.81])
    length = np.linalg.norm(felt, axis=1)
    attitude = np.stack((-np.arcsin(felt[:, 1] / length), np.arctan2(felt[:, 0], felt[:, 2]), 0.0 * time), axis=1)
    noise = rng.standard_normal((2, *acceleration.shape))
    speed = np.sqrt((1 + share) * VEHICLE.mass_kg * length / sum(r.thrust_factor_n_s2 for r in VEHICLE.rotors))
    return Signals(
        time=time,
        vehicle=VEHICLE,
        attitude=attitude,
        body_rate=rotations.body_rate(attitude, np.gradient(attitude, time, axis=0)),
        velocity=np.cumsum(acceleration, axis=0) * PERIOD + 0.02 * noise[0],
        acceleration=acceleration + 0.2 * noise[1],
        rotor_speed=np.tile(speed[:, None], (1, 4)),
    )


def with_wrong_thrust(signals):
    found = fitted([weak(signals, force=True)], (), np.array([1e3, 1e3, 1e3, 0.2, 0.2, 0.2]), GapSettings())
    thrust = next(each for each in found.estimates.parameters if each.name == "thrust_scale")
    return found, named_effect("parameter_error", numbers=[thrust])


@pytest.mark.parametrize(
    ("size", "share", "highest_hz", "rivals"),
    [(0.02, 0.12, 0.5, ["payload"]), (1.0, 0.12, 1.5, []), (0.02, -0.12, 0.5, [])],
    ids=["hardly moves", "would swing", "too much thrust"],
)
def test_a_load_that_hardly_swings_is_a_double_of_too_little_thrust(size, share, highest_hz, rivals):
    found, wrong = with_wrong_thrust(carried(size, share, highest_hz))
    assert wrong.numbers[0].value == pytest.approx(1 / (1 + share) - 1, abs=0.003)
    assert [each.name for each in not_separated(found, wrong)] == rivals
    assert list(not_separated(found._replace(settings=GapSettings(ignore=("payload",))), wrong)) == []


def test_a_flight_of_one_block_shows_no_error_and_beats_no_rival():
    found, wrong = with_wrong_thrust(carried(1.0, 0.12, 1.5))
    short = found._replace(settings=GapSettings(block_s=1e3))
    assert "payload" in [each.name for each in not_separated(short, wrong)]


def number(name, value, half):
    return Estimate(name, "1", value, value - half, value + half, (-0.9, 3.0))


def found(*numbers):
    return Estimates(np.zeros(0), (), numbers, ())


def named(name, *coefficients):
    return named_effect(name, numbers=coefficients, share=0.9)


SURE = number("inertia_x", 0.15, 0.02)


def result(*numbers, effects=(), share=0.5, unknown=0.0):
    known, each = {each.name: each.numbers for each in effects}, (np.broadcast_to(one, 6) for one in (share, unknown))
    effect = wrong_numbers(found(*numbers), known, *each, VehicleSettings())
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


def test_what_a_refit_leaves_shows_in_the_channel_of_its_number():
    assert (result(SURE, share=0.04), result(SURE, unknown=0.14)) == ((), ("inertia_x",))
    assert result(SURE, unknown=0.16) == ()
    elsewhere, there = np.zeros(6), np.zeros(6)
    elsewhere[1:], there[0] = 0.9, 0.9
    assert (result(SURE, share=elsewhere), result(SURE, share=there)) == ((), ("inertia_x",))


def test_probability_is_that_of_a_normal_error_of_the_surest_number():
    effect = wrong_numbers(
        found(SURE, number("inertia_y", 0.05, 0.02)), {}, np.full(6, 0.5), np.zeros(6), VehicleSettings()
    )
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
    assert (result(small, effects=(wrong,)), result(large, effects=(wrong,))) == ((), ("inertia_z",))
    assert result(other, effects=(wrong,)) == ("inertia_x",)


@pytest.mark.parametrize(("inertia", "said"), [(0.0, True), (1 / 0.9 - 1, False)])
def test_where_rates_show_a_wrong_thrust_too_it_is_no_mass(inertia, said):
    numbers = found(number("thrust_scale", -0.1, 0.001), number("inertia_x", inertia, 0.005))
    effect = wrong_numbers(numbers, {}, np.full(6, 0.5), np.zeros(6), VehicleSettings())
    assert ("A mass of" in effect.sentence) is said


def test_numbers_that_no_vehicle_has_are_ratios_to_the_config():
    assert result(number("thrust_scale", 0.5, 0.01), effects=[named("payload")]) == ()
    surely = Estimate("inertia_z", "1", 11.0, 10.999, 11.001, (-0.7, 2.0))
    assert impossible_ratios([surely, number("inertia_y", 0.1, 0.01)]) == {"inertia_z": 12.0}
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
