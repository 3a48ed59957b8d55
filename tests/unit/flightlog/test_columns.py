import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.flightlog import ImportSettings, SignalMap, import_log

TIME = 0.01 * np.arange(200)
COLUMNS = {
    "body_rate": (("p", "q", "r"), "rad/s"),
    "attitude": (("roll", "pitch", "yaw"), "rad"),
    "position": (("x", "y", "z"), "m"),
    "rotor_speed": (("w1", "w2"), "rad/s"),
    "rotor_command": (("u1", "u2"), "1"),
    "attitude_rate": (("dr", "dp", "dy"), "rad/s"),
    "voltage": (("volt",), "1"),
}


def mapped(*names, needed=()):
    return {name: SignalMap(columns=COLUMNS[name][0], unit=COLUMNS[name][1], required=name in needed) for name in names}


def log(*names):
    columns = [column for name in names for column in COLUMNS[name][0]]
    return {"t": TIME} | {column: 0.1 * np.sin((2 + place) * TIME) for place, column in enumerate(columns)}


def imported(columns, signals, **changes):
    return import_log(columns, ImportSettings(signals=signals, **({"torque_source": None} | changes)))


def test_a_signal_that_a_log_may_lack_is_left_out_and_the_rest_is_the_same():
    signals = mapped("body_rate", "position", "voltage", "rotor_speed")
    whole = imported(log("body_rate", "position", "voltage", "rotor_speed"), signals)
    part = imported(log("body_rate"), signals)
    assert [whole.position is None, whole.voltage is None, whole.rotor_speed is None] == [False] * 3
    assert [part.position, part.voltage, part.rotor_speed] == [None] * 3
    np.testing.assert_array_equal(part.body_rate, whole.body_rate)


def test_a_signal_with_some_of_its_columns_is_an_error_though_it_may_be_lacking():
    columns = log("body_rate", "position")
    del columns["y"]
    with pytest.raises(InputError, match=r"signals.position.columns: the log has no column 'y'"):
        imported(columns, mapped("body_rate", "position"))


def test_a_signal_is_needed_unless_the_config_says_otherwise():
    with pytest.raises(InputError, match=r"signals.position.columns: the log has no column 'x'"):
        imported(log("body_rate"), mapped("body_rate", "position", needed=("position",)))
    assert SignalMap(columns=("x",), unit="m").required


def test_rotors_that_are_to_give_the_torque_and_are_absent_are_named():
    with pytest.raises(InputError) as caught:
        imported(log("body_rate"), mapped("body_rate", "rotor_speed"), torque_source="rotor-speed")
    message = "import.torque_source: 'rotor-speed' needs the signal rotor_speed; the log has no columns of rotor_speed"
    assert str(caught.value) == message


def test_euler_rates_without_the_attitude_that_the_log_lacks_are_refused():
    with pytest.raises(InputError, match=r"attitude_rate needs attitude.*the log has no columns of attitude$"):
        imported(log("attitude_rate", "rotor_command"), mapped("attitude", "attitude_rate", "rotor_command"))


def test_a_log_that_tells_neither_of_the_rotation_nor_of_the_rotors_is_refused():
    with pytest.raises(InputError, match=r"a flight needs one of attitude, .*no columns of body_rate, rotor_speed"):
        imported(log("position"), mapped("position", "body_rate", "rotor_speed"))
    with pytest.raises(InputError, match=r"no columns of body_rate$"):
        imported(log(), mapped("body_rate"))


def test_commands_alone_are_a_flight():
    flight = imported(log("rotor_command", "position"), mapped("rotor_command", "position", "body_rate"))
    assert (flight.attitude, flight.body_rate) == (None, None)
    assert flight.rotor_command.shape == (200, 2)
