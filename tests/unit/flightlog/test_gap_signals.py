"""Thrust, voltage, specific force and raw rotors: what the comparison of a model with a flight reads."""

import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.flightlog.importing import import_log
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap
from cpfls_cli.flightlog.smoothing import low_pass

TIME = 0.01 * np.arange(400)
GRAVITY = 9.80665


def log():
    waves = {name: np.sin((1 + 0.3 * place) * TIME) for place, name in enumerate(("p", "q", "r", "fx", "fy"))}
    shaped = {"fz": GRAVITY + 0.2 * np.cos(3 * TIME), "thrust": 5 + np.sin(7 * TIME), "volt": 16.8 - 0.3 * TIME}
    attitude = {"roll": 0.3 * np.sin(TIME), "pitch": 0.2 * np.cos(2 * TIME), "yaw": 0.5 * TIME}
    rng = np.random.default_rng(3)
    rotors = {f"{name}{rotor}": 300 + 50 * rng.standard_normal(400) for name in "wu" for rotor in range(4)}
    return {"t": TIME} | waves | shaped | attitude | rotors


SIGNALS = {
    "body_rate": SignalMap(columns=("p", "q", "r"), unit="rad/s"),
    "acceleration": SignalMap(columns=("fx", "fy", "fz"), unit="m/s^2"),
    "thrust": SignalMap(columns=("thrust",), unit="N"),
    "voltage": SignalMap(columns=("volt",), unit="V"),
    "rotor_speed": SignalMap(columns=tuple(f"w{rotor}" for rotor in range(4)), unit="rad/s"),
    "rotor_command": SignalMap(columns=tuple(f"u{rotor}" for rotor in range(4)), unit="rad/s"),
}
ATTITUDE = {"attitude": SignalMap(columns=("roll", "pitch", "yaw"), unit="rad")}


def imported(columns=None, more=None, **changes):
    given = {"signals": SIGNALS | (more or {}), "torque_source": None, "acceleration_frame": "body-specific-force"}
    return import_log(columns or log(), ImportSettings(**(given | changes)))


def test_measured_and_commanded_rotors_come_back_as_logged():
    flight, columns = imported(), log()
    for name, letter in (("rotor_speed", "w"), ("rotor_command", "u")):
        logged = np.column_stack([columns[f"{letter}{rotor}"] for rotor in range(4)])
        np.testing.assert_allclose(getattr(flight, name), logged, rtol=1e-9)
    assert flight.body_torque is None


def test_thrust_and_voltage_have_one_value_for_each_sample():
    flight, columns = imported(), log()
    assert flight.thrust.shape == flight.voltage.shape == (400,)
    np.testing.assert_allclose(flight.thrust, columns["thrust"], rtol=1e-9)
    np.testing.assert_allclose(flight.voltage, columns["volt"], rtol=1e-9)


def test_without_attitude_the_accelerometer_stays_and_no_acceleration_is_made_up():
    flight, columns = imported(body_frame="FRD"), log()
    assert flight.acceleration is None
    expected = np.column_stack([columns["fx"], -columns["fy"], -columns["fz"]])
    np.testing.assert_allclose(flight.specific_force, expected, atol=1e-9)


def test_with_attitude_the_acceleration_in_the_world_comes_next_to_it():
    flight = imported(more=ATTITUDE)
    roll, pitch, yaw = flight.attitude.T
    fx, fy, fz = flight.specific_force.T
    # Third row of R = Rz Ry Rx, written out.
    up = -np.sin(pitch) * fx + np.cos(pitch) * np.sin(roll) * fy + np.cos(pitch) * np.cos(roll) * fz
    np.testing.assert_allclose(flight.acceleration[:, 2], up - GRAVITY, atol=1e-9)
    assert np.abs(yaw).max() > 1


def test_an_acceleration_in_the_world_is_no_specific_force():
    assert imported(more=ATTITUDE, acceleration_frame="world").specific_force is None


def test_a_delay_shifts_the_thrust_with_the_commands_and_leaves_the_voltage_with_the_motion():
    flight, columns = imported(delay_s=0.1), log()
    np.testing.assert_allclose(flight.thrust, columns["thrust"][:-10], atol=1e-6)
    np.testing.assert_allclose(flight.voltage, columns["volt"][10:], atol=1e-9)
    np.testing.assert_allclose(flight.specific_force[:, 2], columns["fz"][10:], atol=1e-9)


@pytest.mark.parametrize("name", ["thrust", "voltage", "specific_force"])
def test_new_signals_pass_the_filter_that_all_pass(name):
    raw, filtered = imported(), imported(lowpass_hz=2.0)
    expected = low_pass(getattr(raw, name), 100.0, 2.0, 4)
    np.testing.assert_allclose(getattr(filtered, name), expected, rtol=1e-6, atol=1e-9)
    assert imported(rate_hz=50.0).voltage.shape == (200,)


def test_a_gap_and_a_spike_in_new_signals_are_mended():
    columns = log()
    columns["volt"][100:103] = np.nan
    columns["thrust"][200] = 500.0
    flight = imported(columns, spike_deviations=10.0)
    np.testing.assert_allclose(flight.voltage, log()["volt"], rtol=1e-6)
    np.testing.assert_allclose(flight.thrust, log()["thrust"], atol=0.02)
    assert (flight.missing, flight.spikes) == ({"volt": 3}, {"thrust": 1})


def test_a_coarse_voltage_is_not_taken_for_saturated():
    columns = log()
    columns["volt"] = np.round(columns["volt"], 0)
    assert "volt" not in imported(columns).saturated


@pytest.mark.parametrize(
    ("key", "name", "signal"),
    [
        ("signals.voltage.unit", "voltage", SignalMap(columns=("volt",), unit="m")),
        ("signals.thrust.unit", "thrust", SignalMap(columns=("thrust",), unit="N m")),
        ("signals.voltage.columns", "voltage", SignalMap(columns=("volt", "p"), unit="V")),
        ("signals.thrust.columns", "thrust", SignalMap(columns=("p", "q", "r"), unit="N")),
    ],
)
def test_a_thrust_and_a_voltage_have_one_column_in_their_unit(key, name, signal):
    with pytest.raises(SettingError) as caught:
        imported(more={name: signal})
    assert caught.value.key == key


def test_a_voltage_as_share_of_the_full_battery_keeps_its_numbers():
    share = SignalMap(columns=("volt",), unit="1", scale=1 / 16.8)
    np.testing.assert_allclose(imported(more={"voltage": share}).voltage, log()["volt"] / 16.8, rtol=1e-9)
