import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.conversion import (
    acceleration_from_specific_force,
    attitude_to_enu_flu,
    drop_absent_signals,
    to_program_frames,
)
from cpfls_cli.flightlog.importing import import_log
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap

NAMES = ("roll", "pitch", "yaw")


def columns(attitude, **others):
    time = 0.01 * np.arange(len(attitude))
    return {"t": time} | dict(zip(NAMES, attitude.T, strict=True)) | others


@pytest.mark.parametrize(
    ("ned", "enu"),
    [
        ((0, 0, 0), (0, 0, 90)),
        ((0, 0, 90), (0, 0, 0)),
        ((10, 0, 90), (10, 0, 0)),
        ((0, 10, 90), (0, -10, 0)),
        ((5, -7, 30), (5, 7, 60)),
    ],
)
def test_forward_right_down_in_north_east_down_gives_the_known_angles(ned, enu):
    """North is yaw 90 in ENU; nose up is a positive pitch in FRD and a negative one in FLU."""
    np.testing.assert_allclose(np.rad2deg(attitude_to_enu_flu(np.deg2rad([ned]), "FRD", "NED")), [enu], atol=1e-9)


def test_rates_of_a_flight_in_frd_ned_agree_with_its_converted_attitude():
    """Without a gyroscope and with one, in other axes, the same flight comes out."""
    time = 0.01 * np.arange(500)
    attitude = np.column_stack([0.4 * np.sin(time), 0.3 * np.cos(1.3 * time), 0.9 * time])
    rates = np.gradient(attitude, 0.01, axis=0, edge_order=2)
    roll, pitch = attitude[:, 0], attitude[:, 1]
    gyro = np.column_stack(
        [
            rates[:, 0] - np.sin(pitch) * rates[:, 2],
            np.cos(roll) * rates[:, 1] + np.sin(roll) * np.cos(pitch) * rates[:, 2],
            -np.sin(roll) * rates[:, 1] + np.cos(roll) * np.cos(pitch) * rates[:, 2],
        ]
    )
    log = columns(attitude, p=gyro[:, 0], q=gyro[:, 1], r=gyro[:, 2])
    frames = {"body_frame": "FRD", "world_frame": "NED", "torque_source": None}
    euler = {"attitude": SignalMap(columns=NAMES, unit="rad")}
    both = euler | {"body_rate": SignalMap(columns=("p", "q", "r"), unit="rad/s")}
    from_attitude = import_log(log, ImportSettings(signals=euler, **frames))
    from_gyro = import_log(log, ImportSettings(signals=both, **frames))
    np.testing.assert_allclose(from_attitude.body_rate, from_gyro.body_rate, atol=2e-4)
    np.testing.assert_allclose(from_gyro.body_rate, gyro * [1, -1, -1], atol=1e-12)
    derived = np.gradient(from_gyro.attitude, 0.01, axis=0)
    np.testing.assert_allclose(from_gyro.attitude_rate[1:-1], derived[1:-1], atol=2e-4)


def test_a_resting_accelerometer_means_no_acceleration():
    attitude = np.deg2rad([[0.0, 0.0, 40.0], [30.0, 0.0, 0.0], [0.0, 20.0, 10.0]])
    sensed = 9.80665 * np.array(
        [
            [0, 0, 1],
            [0, np.sin(attitude[1, 0]), np.cos(attitude[1, 0])],
            [-np.sin(attitude[2, 1]), 0, np.cos(attitude[2, 1])],
        ]
    )
    np.testing.assert_allclose(acceleration_from_specific_force(attitude, sensed), 0, atol=1e-12)


def test_positions_in_ned_become_enu():
    log = columns(np.zeros((100, 3)), n=np.full(100, 1.0), e=np.full(100, 2.0), d=np.full(100, -3.0))
    mapped = {"position": SignalMap(columns=("n", "e", "d"), unit="m")}
    flight = import_log(log, ImportSettings(signals=mapped, world_frame="NED", torque_source=None))
    np.testing.assert_allclose(flight.position[0], [2, 1, 3])


ROTORS = SignalMap(columns=("m1", "m2", "m3", "m4"), unit="1")
SHARES = np.array([[0.0, 0.25, 0.64, 1.0], [-0.1, 0.04, 0.5, 0.81]])


@pytest.mark.parametrize(
    ("meaning", "kept"), [("speed", SHARES), ("thrust", [[0.0, 0.5, 0.8, 1.0], [0.0, 0.2, np.sqrt(0.5), 0.9]])]
)
def test_a_command_is_kept_as_a_share_of_speed(meaning, kept):
    settings = ImportSettings(signals={"rotor_command": ROTORS}, torque_source=None, rotor_command_is=meaning)
    assert to_program_frames({"rotor_command": SHARES}, settings)["rotor_command"] == pytest.approx(np.array(kept))


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


def test_a_signal_of_several_topics_is_left_out_where_some_of_them_are_not_there():
    columns = ["PSCD.TPD", "PSCD.DVD", "RATE.R", "PSCN.DVN"]
    position, velocity = (
        SignalMap(columns=own, unit=unit, required=False)
        for own, unit in ((("PSCN.TPN", "PSCE.TPE", "PSCD.TPD"), "m"), (("PSCN.DVN", "PSCE.DVE", "PSCD.DVD"), "m/s"))
    )
    rate = SignalMap(columns=("RATE.R", "RATE.P", "RATE.Y"), unit="deg/s", required=False)
    signals = {"setpoint_position": position, "setpoint_velocity": velocity, "body_rate": rate}
    kept = drop_absent_signals(columns, ImportSettings(signals=signals, torque_source=None)).signals
    # PSCN is there and lacks a column: that is named, as a column of a required signal is.
    assert kept.keys() == {"setpoint_position", "body_rate"}


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


def test_a_log_that_shows_neither_of_the_rotation_nor_of_the_rotors_is_refused():
    with pytest.raises(InputError, match=r"a flight needs one of attitude, .*no columns of body_rate, rotor_speed"):
        imported(log("position"), mapped("position", "body_rate", "rotor_speed"))
    with pytest.raises(InputError, match=r"no columns of body_rate$"):
        imported(log(), mapped("body_rate"))


def test_commands_alone_are_a_flight():
    flight = imported(log("rotor_command", "position"), mapped("rotor_command", "position", "body_rate"))
    assert (flight.attitude, flight.body_rate) == (None, None)
    assert flight.rotor_command.shape == (200, 2)


def test_what_goes_into_a_mixer_becomes_the_share_of_each_rotor():
    """Three motors from a thrust and a roll: none gives more than all it has, or less than nothing."""
    thrust, roll = np.array([0.5, 0.9, 0.1] * 10), np.array([0.0, 0.4, -0.4] * 10)
    mixed = SignalMap(columns=("T", "l"), unit="1", scale=0.01, mixer=((1.0, -0.5), (1.0, 0.5), (0.5, 0.0)))
    settings = ImportSettings(signals={"rotor_command": mixed}, torque_source=None)
    flight = import_log({"t": 0.01 * np.arange(30), "T": 100 * thrust, "l": 100 * roll}, settings)
    expected = [[0.5, 0.5, 0.25], [0.7, 1.0, 0.45], [0.3, 0.0, 0.05]] * 10
    np.testing.assert_allclose(flight.rotor_command, expected, atol=1e-12)


def test_columns_of_other_lengths_than_the_stamps_are_said():
    log = columns(np.zeros((50, 3)))
    log["pitch"] = np.zeros(100)
    settings = ImportSettings(signals={"attitude": SignalMap(columns=NAMES, unit="rad")}, torque_source=None)
    with pytest.raises(InputError, match=r"import\.signals\.attitude\.columns: 100 values for 50 time stamps"):
        import_log(log, settings)
