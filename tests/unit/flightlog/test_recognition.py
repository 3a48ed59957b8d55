"""Columns recognised: a made-up flight written down in many ways, each of which has one right answer."""

from itertools import permutations, product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.attitude_columns import Reading
from cpfls_cli.flightlog.conversion import to_program_frames
from cpfls_cli.flightlog.names import nameless_clock, nameless_signals
from cpfls_cli.flightlog.recognition import recognise
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.units import known_unit
from tests.builders.unknown_logs import FLIP, NED, flat_log, flight, named, quaternion, with_ground

GYRO = ("gyro_x", "gyro_y", "gyro_z")
ACC = ("acc_x", "acc_y", "acc_z")
PLACE, SPEED = ("x", "y", "z"), ("vx", "vy", "vz")
LONG = flight(seconds=80.0, rate_hz=400.0, noise=0.1)
HALVED = np.r_[0:16000:2, 16000:32000]


@pytest.fixture(scope="module")
def own():
    return flight(seconds=20.0)


def seen(log):
    return recognise(log.topics, log.units, log.parameters, log.system)


def imported(log, recognition):
    """What the import makes of the log by this recognition: arrays in FLU, ENU and SI."""
    signals = {guess.signal: guess.columns for guess in recognition.signals}
    choices = {choice.key: choice.value for choice in recognition.choices}
    settings = ImportSettings(signals=signals, torque_source=None, time_column="t", **choices)
    values = {}
    for name, columns in signals.items():
        logged = np.column_stack([log.topics[""][column] for column in columns.columns])
        scaled = (columns.scale * logged + columns.offset) * np.asarray(columns.sign or 1.0)
        values[name] = scaled * known_unit(columns.unit).factor
    return to_program_frames(values, settings)


def assert_the_flight_comes_back(log, own, *, yaw_turned=False):
    """The import of what was recognised is the flight itself, up to where the world's x points."""
    recognition = seen(log)
    flown = imported(log, recognition)
    up = Rotation.from_euler("ZYX", flown["attitude"][:, ::-1]).as_matrix()[:, 2]
    np.testing.assert_allclose(up, own.rotation.as_matrix()[:, 2], atol=1e-6)
    np.testing.assert_allclose(flown["body_rate"], own.rate, atol=1e-6)
    np.testing.assert_allclose(flown["specific_force"], own.specific_force, atol=1e-6)
    np.testing.assert_allclose(flown["rotor_speed"], own.speed, rtol=1e-9)
    if not yaw_turned:
        np.testing.assert_allclose(flown["position"], own.position, atol=1e-9)
        np.testing.assert_allclose(flown["velocity"], own.velocity, atol=1e-9)
    return recognition


def test_plain_names_in_si_are_taken_as_they_are(own):
    recognition = assert_the_flight_comes_back(flat_log(own), own)
    assert {guess.sure for guess in recognition.signals} <= {"data", "named"}
    assert recognition.left_out == recognition.warnings == ()
    assert recognition.flown.span_s is None
    assert (recognition.time_column, recognition.time_unit) == ("t", "s")


def test_a_gyroscope_in_its_unit_is_as_large_as_the_turning(own):
    recognition = assert_the_flight_comes_back(flat_log(own), own)
    assert recognition.signal("body_rate").reason.endswith("and is as large, so it is in rad/s")


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 0, 2)])
def test_an_attitude_that_is_as_named_is_read_as_if_all_ways_had_been_tried(own, order, monkeypatch):
    log = flat_log(own, rate=named(own.rate[:, list(order)], *GYRO))
    soon = seen(log)
    monkeypatch.setattr(Reading, "beats_all", lambda *_: False)
    assert repr(seen(log)) == repr(soon)


@pytest.mark.parametrize(
    ("order", "scale"),
    [*((order, 1.0) for order in permutations(range(3))), ((0, 1, 2), np.degrees(1.0)), ((0, 1, 2), 1000.0)],
)
def test_axes_of_a_gyroscope_in_any_order_and_its_unit_are_put_right(own, order, scale):
    assert_the_flight_comes_back(flat_log(own, rate=named(scale * own.rate[:, list(order)], *GYRO)), own)


@pytest.mark.parametrize("sign", list(product((1.0, -1.0), repeat=3)))
def test_signs_of_a_gyroscope_are_put_back(own, sign):
    # With quaternions no angle can be reversed in its stead.
    attitude = named(quaternion(own.rotation), "qw", "qx", "qy", "qz")
    assert_the_flight_comes_back(flat_log(own, rate=named(own.rate * sign, *GYRO), attitude=attitude), own)


@pytest.mark.parametrize("sign", [(1, 1, 1), (1, -1, 1), (1, 1, -1), (1, -1, -1)])
@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_angles_of_either_unit_and_of_reversed_axes_are_put_right(own, sign, unit):
    angles = own.angles * sign * (np.degrees(1.0) if unit == "deg" else 1.0)
    recognition = assert_the_flight_comes_back(flat_log(own, attitude=named(angles, "roll", "pitch", "yaw")), own)
    assert recognition.signal("attitude").columns.unit == unit


def test_a_matrix_of_angles_may_hold_yaw_first(own):
    """What is called yaw stays so."""
    held = [f"log/lean/orient[{column}]" for column in range(3)]
    log = flat_log(own, attitude=named(own.angles[:, ::-1], *held))
    assert assert_the_flight_comes_back(log, own).signal("attitude").columns.columns == tuple(held[::-1])
    log = flat_log(own, attitude=named(own.angles[:, ::-1], "roll", "pitch", "yaw"))
    assert seen(log).signal("attitude").columns.columns[2] == "yaw"


def test_what_is_asked_for_begins_with_the_axis_that_the_measured_angles_begin_with(own):
    late = np.roll(own.angles, 5, axis=0)
    asked, flown = ([f"{name}[{column}]" for column in range(3)] for name in ("euler_des", "euler"))
    log = flat_log(own, attitude={**named(own.angles[:, ::-1], *flown), **named(late[:, ::-1], *asked)})
    assert seen(log).signal("setpoint_attitude").columns.columns == tuple(asked[::-1])


@pytest.mark.parametrize("length", [1.0, -9.80665])
def test_gravity_that_is_called_g_is_no_gyroscope(own, length):
    """No attitude would show it."""
    gravity = named(length * own.rotation.as_matrix()[:, 2], "gx", "gy", "gz")
    recognition = seen(flat_log(own, attitude=None, rate=gravity))
    assert "body_rate" not in {guess.signal for guess in recognition.signals}
    recognition = seen(flat_log(own, attitude=None, rate=named(own.rate, "gx", "gy", "gz")))
    assert recognition.signal("body_rate").columns.unit == "rad/s"


def test_the_vector_of_a_quaternion_is_no_three_angles(own):
    orient = named(quaternion(own.rotation), *(f"orient_{axis}" for axis in "wxyz"))
    recognition = assert_the_flight_comes_back(flat_log(own, attitude=orient), own)
    assert recognition.signal("quaternion").columns.columns == tuple(orient)


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
@pytest.mark.parametrize("inverse", [False, True])
def test_quaternions_of_either_order_and_direction_are_distinguished(own, order, inverse):
    rotation = own.rotation.inv() if inverse else own.rotation
    attitude = named(quaternion(rotation, order), "q[0]", "q[1]", "q[2]", "q[3]")
    assert assert_the_flight_comes_back(flat_log(own, attitude=attitude), own).choice("quaternion_order") == order


def test_integers_whose_length_stays_are_a_quaternion(own):
    attitude = named(np.round(8127 * quaternion(own.rotation)), "quat[0]", "quat[1]", "quat[2]", "quat[3]")
    recognition = seen(flat_log(own, attitude=attitude))
    assert recognition.signal("quaternion").columns.columns == ("quat[0]", "quat[1]", "quat[2]", "quat[3]")
    assert recognition.choice("quaternion_order") == "wxyz"
    assert recognition.signal("body_rate").columns.sign is None


def test_four_numbers_that_hardly_change_are_no_quaternion(own):
    warm = 40.0 + 0.1 * np.random.default_rng(1).standard_normal((len(own.time), 4))
    attitude = {**named(own.angles, "roll", "pitch", "yaw"), **named(warm, "q0", "q1", "q2", "q3")}
    recognition = seen(flat_log(own, attitude=attitude))
    assert recognition.signal("attitude").columns.columns == ("roll", "pitch", "yaw")
    assert recognition.signal("attitude").sure == "data"


def test_rows_of_zeros_before_an_estimator_is_ready_are_left_out_of_a_quaternion(own):
    values = np.round(8127 * quaternion(own.rotation))
    values[:50] = 0
    recognition = seen(flat_log(own, attitude=named(values, "q0", "q1", "q2", "q3")))
    assert recognition.signal("quaternion").columns.columns == ("q0", "q1", "q2", "q3")


def test_a_gyroscope_with_other_axes_does_not_hide_the_order_of_a_quaternion(own):
    attitude = named(quaternion(own.rotation, "xyzw"), "q0", "q1", "q2", "q3")
    rate = named(np.degrees(own.rate[:, [1, 2, 0]] * [1, -1, 1]), *GYRO)
    recognition = assert_the_flight_comes_back(flat_log(own, attitude=attitude, rate=rate), own)
    assert recognition.choice("quaternion_order") == "xyzw"


def test_frd_in_ned_is_distinguished_from_flu_in_enu(own):
    turned = Rotation.from_matrix(NED @ own.rotation.as_matrix() @ FLIP)
    log = flat_log(
        own,
        attitude=named(quaternion(turned), "qw", "qx", "qy", "qz"),
        rate=named(own.rate @ FLIP, *GYRO),
        force=named(own.specific_force @ FLIP, *ACC),
        position=named(own.position @ NED.T, *PLACE),
        velocity=named(own.velocity @ NED.T, *SPEED),
    )
    recognition = assert_the_flight_comes_back(log, own)
    assert (recognition.choice("body_frame"), recognition.choice("world_frame")) == ("FRD", "NED")


def test_a_position_in_other_axes_than_the_attitude_is_turned(own):
    turned = Rotation.from_matrix(NED @ own.rotation.as_matrix() @ FLIP)
    log = flat_log(
        own,
        attitude=named(quaternion(turned), "qw", "qx", "qy", "qz"),
        rate=named(own.rate @ FLIP, *GYRO),
        force=named(own.specific_force @ FLIP, *ACC),
    )
    assert_the_flight_comes_back(log, own)


@pytest.mark.parametrize(("factor", "unit", "scale"), [(1 / 9.80665, "g", 1.0), (1000 / 9.80665, "g", 1e-3)])
def test_the_unit_of_an_accelerometer_follows_from_gravity(own, factor, unit, scale):
    columns = seen(flat_log(own, force=named(own.specific_force * factor, *ACC))).signal("acceleration").columns
    assert (columns.unit, columns.scale) == (unit, scale)


def test_gravity_logged_in_place_of_what_carries_is_turned_round(own):
    recognition = assert_the_flight_comes_back(flat_log(own, force=named(-own.specific_force, *ACC)), own)
    assert recognition.signal("acceleration").columns.sign == (-1.0, -1.0, -1.0)


def test_an_acceleration_of_the_world_is_distinguished_from_what_is_sensed(own):
    assert seen(flat_log(own, force=named(own.acceleration, *ACC))).choice("acceleration_frame") == "world"
    with_gravity = seen(flat_log(own, force=named(own.acceleration + np.array([0.0, 0.0, 9.81]), *ACC)))
    assert with_gravity.signal("acceleration") is None
    assert "an acceleration in world axes that includes gravity" in with_gravity.left_out[0]


def test_an_acceleration_of_the_world_in_thousandths_is_said_by_the_motion(own):
    """As a Crazyflie estimates it: without gravity it is taken, with it there is no word for it."""
    thousandths = {"position": named(1e3 * own.position, *PLACE), "velocity": named(1e3 * own.velocity, *SPEED)}
    log = flat_log(own, force=named(1e3 * own.acceleration, "ax", "ay", "az"), **thousandths)
    recognition = seen(log)
    np.testing.assert_allclose(imported(log, recognition)["acceleration"], own.acceleration, atol=1e-9)
    with_gravity = named(1e3 * (own.acceleration + np.array([0.0, 0.0, 9.81])), "ax", "ay", "az")
    recognition = seen(flat_log(own, force=with_gravity, **thousandths))
    assert recognition.signal("acceleration") is None
    assert any("an acceleration in world axes that includes gravity" in words for words in recognition.left_out)


DOTS = ("roll_dot", "pitch_dot", "yaw_dot")


@pytest.mark.parametrize("unit", [1.0, np.degrees(1)])
@pytest.mark.parametrize("way", [(1, 1, 1), (1, -1, 1)])
def test_derivatives_of_angles_are_body_rates_where_they_follow_the_attitude_as_such(own, unit, way):
    """As they lean and turn, they differ from derivatives; a yaw jumps by full turns."""
    log = flat_log(own, rate=named(own.rate * way * unit, *DOTS))
    angles = own.rotation.as_euler("ZYX")[:, ::-1] * way
    log.topics[""] |= dict(zip(("roll", "pitch", "yaw"), angles.T, strict=True))
    found = seen(log).signal("body_rate")
    assert found.columns.columns == DOTS
    assert known_unit(found.columns.unit).factor * found.columns.scale == pytest.approx(1 / unit)


def test_a_calm_flight_whose_angles_are_small_in_degrees_keeps_its_body_rates():
    calm = flight(seconds=20.0, angle=0.02)
    log = flat_log(calm, attitude=named(np.degrees(calm.angles), "roll", "pitch", "yaw"), rate=named(calm.rate, *DOTS))
    assert seen(log).signal("body_rate").columns.columns == DOTS


def test_a_gyroscope_is_taken_before_what_is_called_a_derivative(own):
    """Where the vehicle hardly leans both are alike, but for noise of the attitude."""
    log = flat_log(own)
    log.topics[""] = {**named(own.rate + 0.01, *DOTS), **log.topics[""]}
    assert seen(log).signal("body_rate").columns.columns == GYRO


def test_derivatives_of_angles_that_are_no_body_rates_are_left_out(own):
    rates = np.gradient(np.unwrap(own.rotation.as_euler("ZYX")[:, ::-1], axis=0), 0.01, axis=0)
    assert "body_rate" not in [guess.signal for guess in seen(flat_log(own, rate=named(rates, *DOTS))).signals]


def test_a_gyroscope_is_taken_before_what_is_derived_of_the_attitude(own):
    """Motion capture is full of noise where that is fast, and so is its derivative, whatever it is called."""
    tracked = own.rotation * Rotation.from_rotvec(5e-3 * np.random.default_rng(1).normal(size=(len(own.time), 3)))
    steps = 100.0 * (tracked[:-1].inv() * tracked[1:]).as_rotvec()
    derived = named(np.vstack([steps, steps[-1:]]), "wx", "wy", "wz")
    angles = named(tracked.as_euler("ZYX")[:, ::-1], "roll", "pitch", "yaw")
    gyroscope = named(own.rate, "imu_gyro_x", "imu_gyro_y", "imu_gyro_z")
    recognition = seen(flat_log(own, attitude=angles, rate=derived, sensed=gyroscope))
    assert recognition.signal("body_rate").columns.columns == tuple(gyroscope)
    assert any(words.startswith("wx, wy, wz: also a body rate, but the derivative") for words in recognition.left_out)
    assert seen(flat_log(own, attitude=angles, rate=derived)).signal("body_rate").columns.columns == tuple(derived)


def test_a_velocity_in_body_axes_is_left_out(own):
    recognition = seen(flat_log(own, velocity=named(own.rotation.inv().apply(own.velocity), *SPEED)))
    assert recognition.signal("velocity") is None
    assert "a velocity in body axes" in recognition.left_out[0]


def test_the_position_whose_derivative_is_the_velocity_is_taken_and_the_other_one_named(own):
    drifting = own.position + np.random.default_rng(4).normal(0.0, 0.3, own.position.shape).cumsum(axis=0)
    both = named(drifting, "x", "y", "z") | named(own.position, "mocap_x", "mocap_y", "mocap_z")
    recognition = seen(flat_log(own, position=both))
    assert recognition.signal("position").columns.columns == ("mocap_x", "mocap_y", "mocap_z")
    assert any(words.startswith("x, y, z: also a position; its") for words in recognition.left_out)


def test_of_two_positions_that_fit_the_velocity_the_first_by_name_is_taken(own):
    both = named(own.position, "x", "y", "z") | named(own.position + 1.0, "mocap_x", "mocap_y", "mocap_z")
    recognition = seen(flat_log(own, position=both))
    assert recognition.signal("position").columns.columns == PLACE
    assert recognition.left_out == ("mocap_x, mocap_y, mocap_z: also position by name; not used",)


@pytest.mark.parametrize(("times", "unit", "scale"), [(1000, "mm/s", 1.0), (100, "m/s", 0.01), (1, "m/s", 1.0)])
def test_a_velocity_is_in_the_unit_that_the_position_makes_it(own, times, unit, scale):
    log = flat_log(own, position=named(1000 * own.position, *PLACE), velocity=named(times * own.velocity, *SPEED))
    recognition = assert_the_flight_comes_back(log, own)
    found = recognition.signal("velocity").columns
    assert (found.unit, found.scale) == (unit, scale)
    # By what the lean does.
    assert recognition.signal("position").columns.unit == "mm"


def test_no_fall_is_faster_than_a_multirotor_flies(own):
    # Without an attitude nothing but its speed shows the unit of a position.
    sinks = own.position - [0.0, 0.0, 2.0] * np.maximum(own.time - 10.0, 0.0)[:, None]
    recognition = seen(flat_log(own, position=named(1000 * sinks, *PLACE), velocity={}, attitude={}))
    assert recognition.signal("position").columns.unit == "mm"
    assert not recognition.flown.moments


@pytest.mark.parametrize(
    ("values", "unit", "scale", "offset"),
    [
        (lambda speed: speed / 1000, "1", 1.0, 0.0),
        (lambda speed: speed / 10, "1", 0.01, 0.0),
        (lambda speed: 1000 + speed, "1", 1e-3, -1.0),
        (lambda speed: 65.536 * speed, "1", 1 / 65536, 0.0),
        (lambda speed: np.round(0.25 * speed), "1", 1 / 255, 0.0),
        (lambda speed: 1 + speed / 1000, "1", 1.0, -1.0),
    ],
)
def test_the_range_of_a_command_shows_its_unit(own, values, unit, scale, offset):
    speed = named(values(own.speed), "cmd1", "cmd2", "cmd3", "cmd4")
    columns = seen(flat_log(own, speed=speed)).signal("rotor_command").columns
    assert (columns.unit, columns.scale, columns.offset) == (unit, pytest.approx(scale), pytest.approx(offset))


def test_thrusts_may_be_as_large_as_pulses_in_milliseconds(own):
    guess = seen(flat_log(own, speed=named(1 + own.speed / 1000, "u1", "u2", "u3", "u4"))).signal("rotor_command")
    assert (guess.sure, guess.rivals[0].text) == ("guess", "scale: 1, offset: 0")


def test_shares_of_a_crazyflie_are_of_no_16_bits(own):
    """Drawn as 0 to 1, as a simulation of it logs them."""
    shares = named((own.speed / 1000) ** 2, "motor.m1", "motor.m2", "motor.m3", "motor.m4")
    degrees = named(np.degrees(own.angles) * [1, -1, 1], "stabilizer.roll", "stabilizer.pitch", "stabilizer.yaw")
    assert seen(flat_log(own, speed=shares, attitude=degrees)).signal("rotor_command").columns.scale == 1.0


@pytest.mark.parametrize("name", ["R_cmd", "output_rot", "rotor_R"])
def test_a_rotation_that_is_asked_for_is_no_command_of_rotors(own, name):
    nine = named(own.rotation.as_matrix().reshape(-1, 9), *(f"{name}[{row}]" for row in range(9)))
    pulses = named(1000 + own.speed, *(f"motor_pwm[{rotor}]" for rotor in range(4)))
    assert seen(flat_log(own, speed={**nine, **pulses})).signal("rotor_command").columns.columns == tuple(pulses)


def test_outputs_without_a_motor_are_left_out(own):
    idle = np.full((len(own.time), 2), 1500.0)
    names = [f"motor{number}_pwm" for number in range(1, 7)]
    guess = seen(flat_log(own, speed=named(np.hstack([1000 + own.speed, idle]), *names))).signal("rotor_command")
    assert guess.columns.columns == tuple(names[:4])


PWM = [f"pwm.m{motor}_pwm" for motor in range(1, 5)]


@pytest.mark.parametrize(("beside", "meant"), [((), "speed"), (PWM, "thrust")])
def test_commands_of_a_crazyflie_are_what_its_motors_get_unless_it_logs_these_too(own, beside, meant):
    """Its firmware before November 2022 logs what was asked for, and the PWM in columns of their own."""
    commands, rate = 65.536 * own.speed, np.degrees(own.rate)
    columns = named(commands, *(f"motor.m{motor}" for motor in range(1, 5)))
    columns |= named(1.1 * commands, *beside) if beside else {}
    recognition = seen(flat_log(own, speed=columns, rate=named(rate, "gyro.x", "gyro.y", "gyro.z")))
    assert recognition.signal("rotor_command").columns.columns[0] == "motor.m1"
    (choice,) = [each for each in recognition.choices if each.key == "rotor_command_is"]
    assert choice.value == meant


def logged_with_speeds(own, commands, speeds):
    columns = named(speeds, *(f"rotor_speed_{motor}" for motor in range(1, 5)))
    columns |= named(commands, *(f"motor{motor}_pwm" for motor in range(1, 5)))
    recognition = seen(flat_log(own, speed=columns))
    assert recognition.signal("rotor_speed").columns.columns[0] == "rotor_speed_1"
    (choice,) = [each for each in recognition.choices if each.key == "rotor_command_is"]
    return choice


@pytest.mark.parametrize("sags", [False, True])
@pytest.mark.parametrize(("power", "meant"), [(1.0, "speed"), (0.6, "thrust"), (0.73, "speed")])
def test_measured_speeds_say_what_commands_are_shares_of(power, meant, sags):
    own = flight(seconds=20.0, climb=4.0, highest_hz=0.8)
    volts = np.linspace(1.0, 0.85 if sags else 1.0, len(own.time))[:, None]
    choice = logged_with_speeds(own, 1000 + 1000 * (own.speed / 1500 / volts) ** (1 / power), own.speed)
    assert (choice.value, choice.sure, len(choice.rivals)) == (meant, "guess", 1)
    assert f"to the power of {power:.1g}" in choice.reason


@pytest.mark.parametrize("follows", ["against", "hardly", "noise", "drift"])
def test_speeds_that_follow_no_commands_say_nothing_of_them(follows):
    own = flight(seconds=20.0, climb=4.0, highest_hz=0.8)
    share, rng = own.speed / 1500, np.random.default_rng(0)
    steady = 700.0 + 5.0 * rng.standard_normal(own.speed.shape)
    drift = np.linspace(0.4, 0.6, len(share))[:, None] + 0.002 * rng.standard_normal(share.shape)
    given = {
        "against": (1 - share, own.speed), "hardly": (share**5, own.speed),
        "noise": (share, steady), "drift": (drift, steady),
    }  # fmt: skip
    commands, speeds = given[follows]
    choice = logged_with_speeds(own, 1000 + 1000 * commands, speeds)
    assert (choice.value, choice.sure) == ("speed", "guess")
    assert "power" not in choice.reason


def test_commands_that_blow_up_are_said_with_the_moment(own):
    commands = 65.536 * own.speed
    commands[1500:, 1] = 1.25e6
    recognition = seen(flat_log(own, speed=named(commands, "motor_m1", "motor_m2", "motor_m3", "motor_m4")))
    assert recognition.rotors == 0
    (warning,) = recognition.warnings
    assert "motor_m2, which reaches 1.25e+06: no command is that large, from 15 s after the first stamp on" in warning
    assert warning.endswith("take the rows from there on out of the log, and run cpfls init again")


@pytest.mark.parametrize(("name", "stamps_s", "unit"), [("timestamp", 1e-6, "us"), ("millis", 1e-3, "ms")])
def test_stamps_in_another_unit_are_known_by_their_steps_and_a_counter_is_a_clock(own, name, stamps_s, unit):
    recognition = seen(flat_log(own, t={name: np.round(own.time / stamps_s)}))
    assert (recognition.time_column, recognition.time_unit) == (name, unit)


@pytest.mark.parametrize("degrees", [1.0, 180 / np.pi])
def test_rows_without_stamps_come_as_often_as_the_attitude_turns_as_the_gyroscope_reads(own, degrees):
    log = flat_log(
        own, t=None, rate=named(degrees * own.rate, *GYRO), attitude=named(degrees * own.angles, "roll", "pitch", "yaw")
    )
    recognition = seen(log)
    assert (recognition.time_column, recognition.time_unit) == (f"row / {1 / own.time[1]:g}", "s")
    assert recognition.warnings[0].startswith(f"it has no stamps: row / {1 / own.time[1]:g} is taken for them")
    assert recognition.signal("body_rate").columns.unit == ("rad/s" if degrees == 1.0 else "deg/s")
    with pytest.raises(InputError, match=r"import.time_column = row / 100 where 100 rows come in a second"):
        # Of another flight.
        seen(flat_log(own, t=None, rate=named(own.rate[::-1], *GYRO)))
    with pytest.raises(InputError, match="no column of time stamps is recognised"):
        # As a matrix of another length.
        seen(flat_log(own, t=None, rate=named(own.rate[::2], *GYRO)))


@pytest.mark.parametrize(
    "changed",
    [
        # Counts of 16 bits would come 16 times as often in deg/s, and thousandths of rad/s 17 times.
        {"rate": named(np.round(16.4 * 180 / np.pi * LONG.rate), *GYRO)},
        {"rate": named(np.round(1000 * LONG.rate), *GYRO)},
        # Taken for radians, of rows that come 7 times in a second.
        {"attitude": named(2 * LONG.angles, "roll", "pitch", "yaw"), "rate": named(2 * np.pi / 180 * LONG.rate, *GYRO)},
        # Of rows that come half as often in the first half.
        {
            **dict.fromkeys(("force", "position", "velocity", "speed")),
            "attitude": named(LONG.angles[HALVED], "roll", "pitch", "yaw"),
            "rate": named(LONG.rate[HALVED], *GYRO),
        },
        # Of other rows than the rest.
        {"attitude": named(LONG.angles[::2], "roll", "pitch", "yaw"), "rate": named(LONG.rate[::2], *GYRO)},
    ],
)
def test_rows_without_stamps_are_not_timed_by_a_gyroscope_whose_unit_or_rows_are_in_doubt(changed):
    with pytest.raises(InputError, match="no column of time stamps is recognised"):
        seen(flat_log(LONG, t=None, **changed))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"speed": named(np.zeros((2000, 4)), "cmd1", "cmd2", "cmd3", "cmd4")}, "the rotors (cmd*) never change"),
        ({"t": None, "attitude": None}, "no column of time stamps is recognised"),
        (
            {"t": {"t": np.arange(2000) % 1500 * 0.015}},
            "t falls once, at row 1501 of 2000, from 22.485 to 0: keep the rows of one flight",
        ),
        (
            {"t": {"t": np.arange(2000) // 60 * 1.0}},
            "as no clock of a flight does: log finer stamps, or write one row for each stamp",
        ),
    ],
)
def test_what_is_no_flight_is_refused(own, changed, message):
    with pytest.raises(InputError, match=message.replace("(", r"\(").replace(")", r"\)").replace("*", r"\*")):
        seen(flat_log(own, **changed))


def test_what_shows_no_flight_is_said_with_what_it_holds(own):
    bare = flat_log(own, **dict.fromkeys(("speed", "rate", "position", "velocity")))
    with pytest.raises(InputError, match=r"^holds attitude and acceleration alone: no rotors, no height and no rates"):
        seen(bare)


def test_what_is_called_like_rotors_is_named_where_its_numbers_are_none(own):
    log = flat_log(own, speed=named(own.speed - own.speed.mean(), "u1", "u2", "u3", "u4"))
    bare = {name: values for name, values in log.topics[""].items() if name in ("t", "u1", "u2", "u3", "u4")}
    with pytest.raises(
        InputError, match=r"^holds u\*, in numbers of no rotors, alone: no rotors, no height and no rates"
    ):
        recognise({"": bare}, {}, {}, "")


def test_a_height_that_no_config_takes_shows_what_flies():
    """Telemetry of a copter without rates and outputs waits, climbs to 20 m and lands."""
    time = 0.1 * np.arange(600)
    angles = 8 * np.sin(np.outer(time, [1.1, 0.9, 0.3]))
    height = 20 * np.clip(np.minimum(time - 10, 50 - time) / 5, 0, 1)
    topics = {
        "ATT": {"timestamp": time, **dict(zip(("Roll", "Pitch", "Yaw"), angles.T, strict=True))},
        "CTUN": {"timestamp": time, "Alt": height},
    }
    found = recognise(topics, {}, {}, "ArduCopter 3.2.1")
    assert [guess.signal for guess in found.signals] == ["attitude"]
    begin, end = found.flown.span_s
    assert (begin, end) == (pytest.approx(10, abs=1.5), pytest.approx(50, abs=1.5))


def test_every_column_of_stamps_that_is_refused_is_said_with_what_else_helps(own):
    stamps = {"t": np.arange(2000) % 1500 * 0.015, "time": np.arange(2000) // 60 * 1.0}
    with pytest.raises(InputError, match=r"^t falls once.*; time rises by 0.*write the config by hand"):
        seen(flat_log(own, t=stamps))


def test_what_is_called_like_stamps_and_seldom_falls_is_said_where_there_is_no_clock(own):
    flights = {"times of flight": np.arange(2000) % 700 * 0.015, "step time": np.tile([0.02, 0.01], 1000)}
    with pytest.raises(InputError, match=r"^times of flight falls 2 times, first at row 701 of 2000[^;]*; rename"):
        seen(flat_log(own, t=flights))
    # A time constant that an estimator changes.
    with pytest.raises(InputError, match=r"^no column of time stamps is recognised"):
        seen(flat_log(own, t={"T": 0.6 + 0.1 * np.sin(np.arange(2000.0))}, attitude=None))


@pytest.mark.parametrize("clock", ["tout", "log/t"])
def test_stamps_of_matlab_are_a_clock(own, clock):
    """In a structure whose other parts are structures, or as Simulink calls them."""
    rates = named(own.rate, *(f"log/own/gyro[{axis}]" for axis in range(3)))
    assert seen(flat_log(own, t={clock: own.time}, rate=rates)).time_column == clock


def test_stamps_that_step_back_are_no_clock_where_another_one_never_does(own):
    late = own.time.copy()
    late[[500, 900]] -= 0.5
    assert seen(flat_log(own, t={"t": late, "timestamp": own.time})).time_column == "timestamp"
    stamps = 1.7e15 + np.round(1e6 * late)
    with pytest.raises(InputError, match=r"^t falls 2 times, .* from 1700000004990000 to 1700000004500000: "):
        seen(flat_log(own, t={"t": stamps}))


@pytest.mark.parametrize("per_second", [1e6, 1e9])
def test_stamps_in_another_unit_than_their_name_says_are_read_by_the_motion(own, per_second):
    unit = {1e6: "us", 1e9: "ns"}[per_second]
    log = flat_log(own, t={"time[ms]": per_second * own.time})
    recognition = seen(log)
    assert (recognition.time_unit, recognition.flown.span_s) == (unit, None)
    assert recognition.warnings[0].endswith(
        f": so it is taken to be in {unit}, in which positions change as velocities say"
    )
    for axis in "xyz":
        del log.topics[""][f"v{axis}"]
    with pytest.raises(InputError, match="never change, or hold too few samples"):
        seen(log)


@pytest.mark.parametrize("scale", [("x", 1e3), ("vx", 1e3)], ids=["positions in mm", "velocities in mm/s"])
def test_stamps_that_are_what_they_say_stay_so_whatever_unit_places_have(own, scale):
    """A clock of 1 kHz in ms counts rows."""
    name, factor = scale
    time = np.arange(20000.0)
    known = {each: np.interp(time / 1000.0, own.time, value) for each, value in flat_log(own).topics[""].items()}
    known |= {axis: factor * known[axis] for axis in (name, name.replace("x", "y"), name.replace("x", "z"))}
    log = flat_log(own)
    log.topics[""] = {each: value for each, value in known.items() if each not in ("t", "time", "time_s")}
    log.topics[""] = {"time[ms]": time} | log.topics[""]
    assert seen(log).time_unit == "ms"


def test_a_date_is_a_clock_whatever_its_name(own):
    log = flat_log(own, t=None)
    log.topics[""]["Date"], log.units["Date"] = own.time + 1.7e9, "s"
    assert seen(log).time_column == "Date"


def test_small_leans_in_degrees_are_no_crash(own):
    """A hover that leans by 0.03 rad, which are 1.7 degrees, and no 1.7 rad."""
    calm = type(own)(**vars(own))
    calm.angles = 0.03 * own.angles / np.abs(own.angles).max()
    calm.angles[1200:, 0] = 0.03
    calm.rate = np.where(own.time[:, None] < 12.0, own.rate, 0.02 * own.rate)
    log = flat_log(calm, attitude=named(np.degrees(calm.angles), "roll", "pitch", "yaw"), force=None)
    log.units.update(roll="deg", pitch="deg", yaw="deg")
    found = seen(log).flown
    assert (found.ended, found.span_s) == ("", None)


def test_a_stand_with_idling_rotors_is_no_flight(own):
    still = with_ground(own, idle=0.3)
    count = 480
    for name in ("time", "angles", "rate", "position", "velocity", "specific_force", "speed"):
        still.__dict__[name] = getattr(still, name)[:count]
    noise = np.random.default_rng(1)
    for name in ("angles", "rate", "position", "velocity", "speed"):
        still.__dict__[name] = getattr(still, name) + noise.normal(0, 1e-3, getattr(still, name).shape)
    with pytest.raises(InputError, match="the vehicle neither turns nor moves"):
        seen(flat_log(still))


def test_what_hardly_turns_flies_where_a_height_alone_says_so():
    time = np.arange(0.0, 22.0, 0.01)
    noise = np.random.default_rng(1).normal(0.0, 0.01, (3, len(time)))
    log = {"t": time, **dict(zip(("xgyro", "ygyro", "zgyro"), noise, strict=True))}
    with pytest.raises(InputError, match="the vehicle neither turns nor moves"):
        recognise({"": log}, {}, {}, "")
    climb = 121.0 + np.interp(time, [8.0, 14.0], [0.0, 5.0]) + noise[0]
    assert recognise({"": log | {"pressure_alt": climb}}, {}, {}, "").flown.flies


def test_a_matrix_without_names_is_recognised_by_how_its_columns_move_together(own):
    body_velocity = own.rotation.inv().apply(own.velocity)
    noise = np.random.default_rng(4).normal(0, 300, (len(own.time), 3))
    table = np.column_stack(
        [own.time, noise, own.rate, quaternion(own.rotation, "xyzw"), own.specific_force, body_velocity, own.position]
    )
    table = np.column_stack([table, own.speed])
    log = {"": {f"data[{column}]": values for column, values in enumerate(table.T)}}
    recognition = recognise(log, {}, {}, "")
    assert (recognition.time_column, recognition.time_unit) == ("data[0]", "s")
    found = {guess.signal: [int(name[5:-1]) for name in guess.columns.columns] for guess in recognition.signals}
    assert found == {
        "body_rate": [4, 5, 6],
        "quaternion": [7, 8, 9, 10],
        "acceleration": [11, 12, 13],
        "position": [17, 18, 19],
        "rotor_speed": [20, 21, 22, 23],
    }
    assert recognition.choice("quaternion_order") == "xyzw"
    assert "columns data[14] to data[16]: a velocity in body axes" in recognition.left_out[0]


def test_a_matrix_keeps_its_clock_over_a_pause_of_the_recording():
    time = 0.018 * np.arange(4000.0)
    time[2000:] += 80.0
    noise = np.random.default_rng(5).normal(size=(len(time), 11))
    log = {f"data[{column}]": values for column, values in enumerate(np.column_stack([time, noise]).T)}
    assert nameless_clock(log) == "data[0]"
    assert nameless_clock(log | {"data[0]": np.cumsum(np.random.default_rng(6).exponential(0.018, len(time)))}) is None


def test_a_flight_that_is_never_near_hover_shows_what_carries_it():
    columns = seen(flat_log(flight(seconds=20.0, push=15.0))).signal("acceleration")
    assert (columns.columns.unit, columns.columns.sign) == ("m/s^2", None)
    assert "times gravity, as it moves" in columns.reason


def test_a_matrix_that_is_written_at_one_instant_has_no_signals():
    assert nameless_signals({f"data[{column}]": np.arange(100.0) for column in range(12)}, np.zeros(100)) == ()


def test_a_jolt_at_touchdown_in_counts_of_a_gyroscope_is_no_loss_of_control():
    """Counts of 16 bits, 16.4 for a deg/s, would be flips in deg/s; the angles show that they are none."""
    own = with_ground(flight(angle=0.08, climb=0.3))
    counts = 16.4 * np.degrees(own.rate)
    touches = np.searchsorted(own.time, 34.7) + np.arange(20)
    counts[touches, 0] += 2 * np.linalg.norm(counts, axis=1).max() * np.sin(2 * np.pi * np.arange(20) / 20)
    log = flat_log(own, rate=named(np.round(counts), *GYRO), force=None, position=None, velocity=None)
    assert recognise(log.topics, log.units, {}, "").flown.ended == ""


def test_counts_of_a_gyroscope_and_thousandths_of_its_rates_are_too_alike_to_choose(own):
    for scale in (16.4 * 180 / np.pi, 1000.0):
        guess = seen(flat_log(own, rate=named(np.round(scale * own.rate), *GYRO))).signal("body_rate")
        assert (guess.columns.unit, guess.columns.scale, guess.sure) == ("rad/s", 0.001, "guess")
        assert "scale: 0.06098" in guess.rivals[0].text
    assert seen(flat_log(own, rate=named(np.degrees(own.rate), *GYRO))).signal("body_rate").sure == "data"


@pytest.mark.parametrize(
    ("per_rad", "unit", "scale"),
    [
        (65.5 * 180 / np.pi, "deg/s", 1 / 65.5),
        (4096.0, "rad/s", 1 / 4096),
        (131 * 180 / np.pi, "deg/s", 1 / 131),
        (32.8 * 180 / np.pi, "deg/s", 1 / 32.8),
    ],
)
def test_counts_of_other_ranges_are_said_by_the_attitude(own, per_rad, unit, scale):
    guess = seen(flat_log(own, rate=named(np.round(per_rad * own.rate), *GYRO))).signal("body_rate")
    assert guess.columns.unit == unit
    assert guess.columns.scale == pytest.approx(scale, rel=1e-6)
    # Two of them are nearer to each other than an attitude can tell.
    near = per_rad in (65.5 * 180 / np.pi, 4096.0)
    assert (guess.sure, len(guess.rivals)) == (("guess", 1) if near else ("data", 0))


def test_a_place_whose_name_does_not_say_so_is_a_guess_where_nothing_shows_it(own):
    place = named(own.position, *(f"bptte.{axis}" for axis in "xyz"))
    others = dict.fromkeys(("velocity", "attitude", "rate", "force", "speed"))
    guess = seen(flat_log(own, position=place, **others)).signal("position")
    assert guess.sure == "guess"
    assert [rival.text for rival in guess.rivals] == ["leave position out"]
    assert seen(flat_log(own, position=place, velocity=None)).signal("position").sure == "data"
    assert not seen(flat_log(own, **others)).signal("position").rivals


def test_columns_of_more_or_fewer_values_than_stamps_are_left_out_and_named():
    own = {"t": np.arange(100.0), **{f"gyro_{axis}": np.arange(100.0 - (axis == "y")) ** 2 for axis in "xyz"}}
    with pytest.raises(
        InputError, match=r"^more or fewer values than stamps \(t\), and left out: gyro_y; write as many"
    ):
        recognise({"": own}, {}, {}, "")
    # A few numbers are of a calibration.
    few = {"t": np.arange(100.0), **{f"gyro/cal[{axis}]": np.arange(4.0) ** axis for axis in (0, 1, 2)}}
    with pytest.raises(InputError, match=r"^no column is recognised as a signal of a flight"):
        recognise({"": few}, {}, {}, "")


def test_single_axes_are_said_to_be_no_signal():
    log = {"": {"t": np.arange(100.0), "Roll": np.arange(100.0) ** 2, "z": np.arange(100.0) ** 3}}
    with pytest.raises(InputError, match=r"Roll, z: single axes, and a signal takes all three; use common names"):
        recognise(log, {}, {}, "")
    log = {"": {"t": np.arange(100.0), "pitch_deg": np.arange(100.0) ** 2, "x1": np.arange(100.0) ** 3}}
    with pytest.raises(InputError, match=r"x1\): pitch_deg: single axes, "):
        recognise(log, {}, {}, "")
    # Of a rotor on a stand, power and torque.
    with pytest.raises(InputError, match=r"P, Q\): use common names"):
        recognise({"": {"t": np.arange(100.0), "P": np.arange(100.0) ** 2, "Q": np.arange(100.0) ** 3}}, {}, {}, "")


def test_a_track_of_positions_is_no_log_of_a_flight():
    log = {"": {name: np.arange(100.0) ** 2 for name in ("millis", "latitude", "Longitude", "altitude", "speed")}}
    log[""]["millis"] = np.arange(100.0)
    with pytest.raises(InputError, match=r"a track of positions \(millis, latitude.* give the autopilot's log"):
        recognise(log, {}, {}, "")
    # Of its stamps and places words say more.
    own = {"UTC (YYYY-MM-DD)": "millis", "Decimal latitude": "latitude", "Altitude above Start Point": "altitude"}
    worded = {own.get(name, name): values for name, values in log[""].items()}
    worded |= {new: worded.pop(old, log[""][old]) for new, old in own.items()}
    with pytest.raises(InputError, match=r"a track of positions \(.*Decimal latitude"):
        recognise({"": worded}, {"UTC (YYYY-MM-DD)": "s"}, {}, "")
    # What else is in it may be motion of the body.
    log[""]["kippwinkel"] = np.arange(100.0) ** 2
    with pytest.raises(InputError, match="no column is recognised as a signal of a flight"):
        recognise(log, {}, {}, "")


@pytest.mark.parametrize("clock", [{}, {"time": np.arange(100.0) / 10}])
def test_a_matrix_without_names_is_called_so(clock):
    """Whether something else has stamps or nothing has."""
    matrix = {f"data[{column}]": np.arange(100.0) ** (column % 3) for column in range(7)}
    held = "a matrix without names" if not clock else "no column is recognised"
    with pytest.raises(InputError, match=held):
        recognise({"": matrix | clock}, {}, {}, "")


def test_columns_of_something_else_are_refused_by_name():
    log = {"": {"t": np.arange(100.0), "price": np.arange(100.0) ** 2}}
    with pytest.raises(InputError, match=r"no column is recognised as a signal of a flight \(columns: t, price\)"):
        recognise(log, {}, {}, "")
