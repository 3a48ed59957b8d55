"""Late and weak actuation, filters, and the law of the battery."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.actuation import second_order
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.lag import delayed, lagged
from cpfls_cli.vehicle.rotors import body_wrench
from cpfls_cli.vehicle.stepping import Machine, RotorMotion
from cpfls_cli.vehicle.values import Each


def step_by_step(link, speed, period):
    """Speeds and accelerations of rotors behind a link, for speeds that are given step by step."""
    rotors = speed.shape[1]

    def build(memory, given):
        passed = link(RotorMotion(Each(given), Each([0.0] * rotors)), memory)
        return *passed.speed, *passed.acceleration

    machine = Machine.of(build, rotors, period)
    return np.split(np.array([machine.advance(tuple(row)) for row in speed.tolist()]), 2, axis=1)


@pytest.mark.parametrize(
    ("name", "shape"), [("motor_lag", {"time_constant_s": 0.05}), ("command_delay", {"delay_s": 0.03})]
)
def test_column_is_true_minus_commanded_wrench(columns, commanded, name, shape):
    true = CATALOGUE[name].apply(commanded, shape)
    assert true.commanded
    change = body_wrench(commanded.vehicle, true.rotor_speed).body_torque - commanded.torque
    found = columns(name, commanded, **shape).direct
    np.testing.assert_allclose(found[:, :3, 0], change, atol=1e-12)
    assert np.abs(found[:, :3]).max() > 0.1


def test_stated_torque_lags_where_rotor_speeds_are_not_logged(columns, flight):
    stated = np.sin(np.outer(flight.time, [3.0, 4.0, 5.0]))
    known = replace(flight, rotor_speed=None, stated_torque=stated, commanded=True)
    found = columns("motor_lag", known, time_constant_s=0.05).direct[..., 0]
    np.testing.assert_allclose(found[:, :3], lagged(stated, 10.0).start - stated, atol=1e-12)
    assert not found[:, 3:].any()


@pytest.mark.parametrize("upper", [(1.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.5, 2.0)])
@pytest.mark.parametrize("frequency", [0.0, 1.0, 3.0, 9.0])
def test_filter_answers_a_wave_as_its_formula_says(upper, frequency):
    natural, damping, period = 3.0, 0.2, 0.002
    time = period * np.arange(5000)
    s = 1j * frequency / natural
    gain = np.polyval(upper, s) / np.polyval((1.0, 2 * damping, 1.0), s)
    wave = np.exp(2j * np.pi * frequency * time)
    found = second_order(natural, damping, period, upper).along(wave)
    np.testing.assert_allclose(found[-500:], gain * wave[-500:], atol=2e-3)


@pytest.mark.parametrize(("name", "breadth"), [("notch_filter", "width"), ("low_pass_filter", "damping")])
def test_a_filter_passes_rotors_step_by_step_as_along_a_flight(commanded, name, breadth):
    known, shape = CATALOGUE[name], {"frequency_hz": 4.0, breadth: 0.7}
    link = known.actuation.link
    speed, acceleration = step_by_step(lambda one, memory: link(one, shape, memory), commanded.speed, commanded.period)
    np.testing.assert_allclose(speed, known.apply(commanded, shape).speed, rtol=1e-12)
    assert not acceleration.any()


def test_battery_takes_the_same_share_of_thrust_and_torque(columns, commanded):
    found = columns("battery_sag", commanded, exponent=1.5).direct[..., 0]
    np.testing.assert_allclose(found, (commanded.voltage**1.5 - 1)[:, None] * commanded.wrench, atol=1e-9)


def test_only_measured_rotors_can_be_late_and_only_commands_can_lag(flight, commanded):
    assert CATALOGUE["channel_delay"].missing(commanded) == ("measured_rotor_speed",)
    assert not CATALOGUE["channel_delay"].missing(flight)
    for name in ("motor_lag", "command_delay", "notch_filter", "low_pass_filter"):
        assert CATALOGUE[name].missing(flight) == ("command",)
        assert not CATALOGUE[name].missing(commanded)


def test_sag_is_looked_for_in_any_rotor_speeds_with_a_voltage(flight, commanded):
    sag = CATALOGUE["battery_sag"]
    assert not sag.missing(flight)
    assert not sag.missing(commanded)
    assert sag.missing(replace(flight, voltage=None)) == ("voltage",)


def test_what_is_applied_before_other_columns_is_what_its_column_says(columns, flight, commanded):
    """The search exchanges the actuation instead of subtracting a column; both must mean the same."""
    actuators = [entry for entry in CATALOGUE.values() if entry.kind == "actuator"]
    others = {"motor_lag", "notch_filter", "low_pass_filter", "command_delay", "battery_sag", "channel_delay"}
    assert {entry.name for entry in actuators} == {*others, "drag_factor_error"}
    for entry in actuators:
        known = flight if entry.name == "channel_delay" else commanded
        shape = {one.name: one.grid[-1] for one in entry.shapes}
        change = entry.apply(known, shape).wrench - known.wrench
        np.testing.assert_allclose(columns(entry.name, known, **shape).direct[..., 0], change, atol=1e-12)


@pytest.mark.parametrize("steps", [0.0, 0.4, 1.0, 2.0, 2.3])
def test_a_delay_taken_step_by_step_is_that_along_a_flight(commanded, steps):
    speed, _ = step_by_step(lambda one, memory: memory.delayed(one, steps), commanded.speed, 1.0)
    np.testing.assert_allclose(speed, delayed(commanded.speed, steps, "linear"), rtol=1e-12)


@pytest.mark.parametrize("ratio", [0.0, 0.3, 3.0])
def test_a_lag_taken_step_by_step_is_that_of_what_stays_the_same_during_each_step(commanded, ratio):
    speed = commanded.speed
    middle, _ = step_by_step(
        lambda one, memory: one._replace(speed=memory.lagged(one.speed, ratio, speed[0])), speed, 1.0
    )
    along = lagged(speed, ratio, "previous")
    expected = speed + (along.start - speed) * (np.exp(-0.5 / ratio) if ratio else 0.0)
    np.testing.assert_allclose(middle, expected, rtol=1e-12)
