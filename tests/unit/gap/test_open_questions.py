"""What stays open: effects that would not show, doubles of wrong numbers, and which way a nameless torque feeds."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli import rotations
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.naming.estimate import fitted
from cpfls_cli.gap.naming.open_questions import energy_directions, not_excited, not_separated
from cpfls_cli.gap.settings import GapSettings
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


def test_high_above_the_ground_its_effect_cannot_show():
    high, low = fly(1), replace(fly(1), ground_height_m=29.5)
    assert "heights" in reasons([high])["ground_effect"]
    assert "ground_effect" not in reasons([low])


def test_a_signal_of_one_flight_is_enough():
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
    still = fly(1, tilt=1e-4, yaw=1e-4, speed=1e-3)
    found = reasons([still])
    for hidden in ("linear_damping", "quadratic_damping", "products_of_inertia", "rotor_drag", "rotor_gyroscopic"):
        assert found[hidden].startswith("it would not show; ")
    assert "torque_bias" not in found


def test_what_is_chosen_or_the_vehicle_itself_is_not_unseen():
    found = reasons([fly(1, tilt=1e-4, yaw=1e-4, speed=1e-3)], [candidate("linear_damping")])
    assert "linear_damping" not in found
    assert "parameter_error" not in found


def test_more_noise_hides_more():
    quiet, loud = reasons([fly(1)], floor=0.1 * FLOOR), reasons([fly(1)], floor=100 * FLOOR)
    assert set(quiet) < set(loud)


def test_damping_drains_and_its_opposite_feeds():
    noise = RNG.normal(size=(400, 3))
    torque = np.column_stack([-0.5 * RATE[:, 0], 0.5 * RATE[:, 1], np.zeros(400)]) + noise
    assert energy_directions(torque, RATE, BLOCK) == ["drains", "feeds", "neither"]


def test_a_constant_torque_does_neither():
    assert energy_directions(np.ones((400, 3)), RATE + 1, BLOCK) == ["neither"] * 3


def test_few_blocks_say_nothing():
    assert energy_directions(-RATE, RATE, BLOCK // 4) == ["neither"] * 3


def test_noise_is_seldom_taken_for_either():
    found = [energy_directions(RNG.normal(size=(400, 3)), RATE, BLOCK) for _ in range(100)]
    assert sum(word != "neither" for words in found for word in words) < 15


def carried(size, share, highest_hz):
    """A flight that leans for its acceleration, of `size` m/s^2, whose rotors pull by a share too much."""
    rng = np.random.default_rng(1)
    time = PERIOD * np.arange(3000)
    acceleration, _, _ = sines(time, [size, size, 0.5 * size], 0.2, highest_hz, rng)
    felt = acceleration + np.array([0.0, 0.0, 9.81])
    length = np.linalg.norm(felt, axis=1)
    angles = -np.arcsin(felt[:, 1] / length), np.arctan2(felt[:, 0], felt[:, 2]), 0.0 * time
    attitude = np.stack(angles, axis=1)
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
    ignoring = found._replace(settings=GapSettings(ignore=("payload",)))
    assert list(not_separated(ignoring, wrong)) == []
