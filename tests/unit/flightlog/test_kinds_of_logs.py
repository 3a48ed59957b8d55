"""The made-up flight as autopilots and robots write it down: topics with clocks of their own, units, parameters."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli.flightlog.airframe import usual_airframe
from tests.builders.topic_logs import ardupilot, maps, proposed, topic
from tests.builders.unknown_logs import FLIP, NED, flat_log, flight, named, quaternion

NAMES = ["front right", "rear left", "front left", "rear right"]


@pytest.fixture(scope="module")
def own():
    return flight(seconds=20.0)


def test_a_log_of_ardupilot_names_its_motors_by_the_functions_of_its_outputs(own):
    functions = {f"SERVO{4 + motor}_FUNCTION": 32.0 + motor for motor in range(1, 5)}
    parameters = {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0, "MOT_PWM_MIN": 1000.0, "MOT_PWM_MAX": 2000.0, **functions}
    proposal = proposed(ardupilot(own), "ArduCopter 4.5.1", parameters, {"ATT.Roll": "deg", "IMU.GyrX": "rad/s"})
    found = maps(proposal)
    assert found["rotor_command"].columns == ("RCOU.C5", "RCOU.C6", "RCOU.C7", "RCOU.C8")
    assert (found["rotor_command"].scale, found["rotor_command"].offset) == pytest.approx((1e-3, -1.0))
    assert found["rotor_speed"].columns == ("ESC.RPM", "ESC[1].RPM", "ESC[2].RPM", "ESC[3].RPM")
    assert found["rotor_speed"].unit == "rpm"
    assert (found["attitude"].unit, found["body_rate"].columns[0]) == ("deg", "IMU.GyrX")
    assert {choice.key: choice.value for choice in proposal.choices}["body_frame"] == "FRD"
    assert [rotor.name for rotor in proposal.airframe.rotors] == NAMES
    assert proposal.warnings == ()


def test_parameters_that_the_motion_contradicts_are_warned_of(own):
    swapped = ardupilot(own)
    swapped["ESC"], swapped["ESC[1]"] = swapped["ESC[1]"], swapped["ESC"]
    (warning,) = proposed(swapped, "ArduCopter 4.5.1", {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0}).warnings
    assert warning.startswith(
        "the rotors are taken from FRAME_CLASS and FRAME_TYPE in the log: quad X, which contradicts"
    )
    assert "rear left counter-clockwise, front right counter-clockwise, front left clockwise" in warning


def test_names_of_columns_that_the_motion_contradicts_are_warned_of(own):
    places = ("FR", "RL", "FL", "RR")
    for order, said in ((places, 0), (("RL", "FR", "FL", "RR"), 1)):
        speeds = named(own.speed, *(f"rpm_{place}" for place in order))
        log = flat_log(own, speed={f"rpm_{place}": 30 / np.pi * speeds[f"rpm_{place}"] for place in places})
        proposal = proposed(log.topics, "")
        warnings = [each for each in proposal.warnings if "which contradicts the names of their columns; " in each]
        assert len(warnings) == said


def test_a_blackbox_log_is_known_by_its_header(own):
    columns = {
        "time": own.time,
        **named(np.degrees(own.rate), *(f"gyroADC[{axis}]" for axis in range(3))),
        **named(own.specific_force / 9.80665, *(f"accSmooth[{axis}]" for axis in range(3))),
        **named(own.speed[:, [3, 0, 1, 2]] * 1.9 + 48, *(f"motor[{motor}]" for motor in range(4))),
    }
    units = {"time": "s", **{f"gyroADC[{axis}]": "deg/s" for axis in range(3)}}
    proposal = proposed({"": columns}, "Betaflight 4.4.2", {"motorOutput": "48,1948"}, units)
    found = maps(proposal)
    assert (found["body_rate"].unit, found["acceleration"].unit) == ("deg/s", "g")
    assert (found["rotor_command"].scale, found["rotor_command"].offset) == pytest.approx((1 / 1900, -48 / 1900))
    assert [rotor.name for rotor in proposal.airframe.rotors] == [
        "rear right",
        "front right",
        "rear left",
        "front left",
    ]
    assert (proposal.time_column, proposal.time_unit) == ("time", "s")


def test_a_fork_of_betaflight_may_have_its_attitude_in_other_axes_and_columns_of_its_own(own):
    turned = Rotation.from_matrix(NED @ own.rotation.as_matrix() @ FLIP)
    columns = {
        "time": own.time,
        **named(np.degrees(own.rate), *(f"gyroADC[{axis}]" for axis in range(3))),
        **named(own.specific_force / 9.80665, *(f"accSmooth[{axis}]" for axis in range(3))),
        **named(own.speed[:, [3, 0, 1, 2]] * 1.9 + 48, *(f"motor[{motor}]" for motor in range(4))),
        **named(own.speed[:, [3, 0, 1, 2]], *(f"omega[{motor}]" for motor in range(4))),
        **named(quaternion(turned), *(f"quat[{part}]" for part in range(4))),
    }
    units = {"time": "s", **{f"gyroADC[{axis}]": "deg/s" for axis in range(3)}}
    proposal = proposed({"": columns}, "Betaflight, as Otherflight 5.0.0", {"motorOutput": "48,1948"}, units)
    found = maps(proposal)
    assert found["body_rate"].sign is None
    assert found["quaternion"].sign == (1.0, 1.0, -1.0, -1.0)
    assert found["rotor_speed"].columns == tuple(f"omega[{motor}]" for motor in range(4))
    assert next(rotor.name for rotor in proposal.airframe.rotors) == "rear right"


def test_the_visual_odometry_of_px4_is_in_its_axes_and_turns_what_another_topic_reads(own):
    """A controller of a laboratory logs rates in the axes of its own world, forward and left exchanged."""
    turned = Rotation.from_matrix(NED @ own.rotation.as_matrix() @ FLIP)
    seen = named(quaternion(turned), *(f"q[{axis}]" for axis in range(4))) | named(own.position @ NED.T, *"xyz")
    rates = named((own.rate @ FLIP)[:, [1, 0, 2]] * [1, 1, -1], *(f"omega[{axis}]" for axis in range(3)))
    motors = named(own.speed / 1000, *(f"control[{rotor}]" for rotor in range(4)))
    proposal = proposed(
        {
            "vehicle_visual_odometry": topic(own, 2, seen),
            "lab_debug": topic(own, 1, rates),
            "actuator_motors": topic(own, 1, motors),
        },
        "PX4 1.13.0",
    )
    choices = {choice.key: choice.value for choice in proposal.choices}
    assert (choices["body_frame"], choices["world_frame"]) == ("FRD", "NED")
    columns = maps(proposal)["body_rate"]
    assert columns.columns == ("lab_debug.omega[1]", "lab_debug.omega[0]", "lab_debug.omega[2]")
    assert columns.sign == (1.0, 1.0, -1.0)


def test_what_no_gyroscope_reads_in_degrees_is_in_its_counts(own):
    # Cleanflight wrote what the sensor gives, 16.4 for each deg/s.
    rate = 16.4 * np.degrees(own.rate) * 600 / np.degrees(np.abs(own.rate)).max()
    # One damaged sample says nothing of the others.
    damaged = rate / 16.4 * np.where(np.arange(len(rate)) == 100, 16.4, 1.0)[:, None]
    columns = {
        "time": own.time,
        **named(own.specific_force / 9.80665 * 4096, *(f"accSmooth[{axis}]" for axis in range(3))),
        **named(own.speed * 1.9 + 1000, *(f"motor[{motor}]" for motor in range(4))),
    }
    found = [
        maps(proposed({"": columns | named(values, *(f"gyroADC[{axis}]" for axis in range(3)))}, ""))["body_rate"]
        for values in (rate, rate / 16.4, damaged)
    ]
    assert [(each.unit, round(each.scale, 4)) for each in found] == [("deg/s", 0.061), ("deg/s", 1.0), ("deg/s", 1.0)]


def test_messages_of_ros_are_known_by_their_fields(own):
    scalar_last = ("orientation.x", "orientation.y", "orientation.z", "orientation.w")
    topics = {
        "/imu/data": topic(own, 1, named(own.rotation.as_quat(), *scalar_last))
        | named(own.rate, *(f"angular_velocity.{axis}" for axis in "xyz"))
        | named(own.specific_force, *(f"linear_acceleration.{axis}" for axis in "xyz")),
        "/odom": topic(own, 2, named(own.position, *(f"pose.pose.position.{axis}" for axis in "xyz")))
        | {
            name: values[::2]
            for name, values in named(
                own.rotation.inv().apply(own.velocity), *(f"twist.twist.linear.{axis}" for axis in "xyz")
            ).items()
        },
        "/motor_speed": topic(own, 2, named(own.speed, *(f"angular_velocities[{motor}]" for motor in range(4)))),
    }
    proposal = proposed(topics, "")
    found = maps(proposal)
    assert set(found) == {"quaternion", "body_rate", "acceleration", "position", "rotor_speed"}
    assert found["rotor_speed"].columns[0] == "/motor_speed.angular_velocities[0]"
    # The twist of an odometry is in the axes of its child, the body.
    assert "a velocity in body axes" in proposal.first.left_out[0]
    assert [rotor.name for rotor in proposal.airframe.rotors] == NAMES
    assert proposal.time_column == "/imu/data.timestamp"


@pytest.mark.parametrize("motors", ["rt_motor", "rt_yout/motors_refout", "rt_yout/motorsRS_cmdout"])
def test_a_parrot_minidrone_counts_motors_that_turn_the_other_way_downward(own, motors):
    turned = Rotation.from_matrix(NED @ own.rotation.as_matrix() @ FLIP)
    commands = 500 * (own.speed / 1000) ** 2 * [1.0, -1.0, 1.0, -1.0]
    columns = {
        "time": own.time,
        **named(turned.as_euler("ZYX")[:, ::-1], *(f"rt_estim/{axis}" for axis in ("roll", "pitch", "yaw"))),
        **named(own.rate @ FLIP, *(f"rt_estim/gyro_{axis}" for axis in "xyz")),
        **named(own.position @ NED.T, *(f"rt_estim/{axis}" for axis in "xyz")),
        **named(commands, *(f"{motors}[{motor}]" for motor in range(4))),
    }
    proposal = proposed({"": columns}, "Parrot minidrone", units={"time": "s"})
    found = maps(proposal)
    assert (found["rotor_command"].scale, found["rotor_command"].sign) == (1 / 500, (1.0, -1.0, 1.0, -1.0))
    choices = {choice.key: choice.value for choice in proposal.choices}
    assert (choices["body_frame"], choices["world_frame"], choices["rotor_command_is"]) == ("FRD", "NED", "thrust")
    usual = usual_airframe("Parrot", 4)
    places = [("front left", -1), ("front right", 1), ("rear right", -1), ("rear left", 1)]
    assert [(rotor.name, rotor.spin) for rotor in usual.rotors] == places


@pytest.mark.parametrize("before", ["", "rt_", "log/"])
def test_p_q_and_r_are_rates_whatever_is_before_them(own, before):
    columns = {
        "time": own.time,
        **named(own.rate, *(f"{before}{axis}" for axis in "pqr")),
        **named(own.angles, *(f"{before}{axis}" for axis in ("roll", "pitch", "yaw"))),
        **named(own.position, *(f"{before}{axis}" for axis in "xyz")),
    }
    found = maps(proposed({"": columns}, "", units={"time": "s"}))
    assert found["body_rate"].columns == tuple(f"{before}{axis}" for axis in "pqr")
    assert found["attitude"].columns == tuple(f"{before}{axis}" for axis in ("roll", "pitch", "yaw"))


def test_neither_a_gyroscope_nor_what_is_asked_of_axes_is_taken_for_rotors(own):
    wave = np.sign(np.sin(2 * np.pi * own.time / 4.0))
    columns = {
        "t": own.time,
        **named(own.rate, *(f"omega[{axis}]" for axis in range(3))),
        **named(own.angles, *(f"euler[{axis}]" for axis in range(3))),
        **named(own.position, *(f"h[{axis}]" for axis in range(3))),
        **named(own.velocity, *(f"v[{axis}]" for axis in range(3))),
        **named(np.outer(wave, [0.4, -0.2, 0.1]), *(f"u_ref[{axis}]" for axis in range(3))),
        **named(own.position, *(f"DesPosSave[{axis}]" for axis in range(3))),
    }
    found = maps(proposed({"": columns}, ""))
    assert found["body_rate"].columns == ("omega[0]", "omega[1]", "omega[2]")
    assert not found.keys() & {"rotor_speed", "rotor_command"}


@pytest.mark.parametrize("before", ["tau_", "acc_", "M_"])
def test_what_else_is_asked_about_axes_is_no_rate(own, before):
    columns = {
        "time": own.time,
        **named(own.rate, *(f"{before}{axis}" for axis in "pqr")),
        **named(own.angles, "roll", "pitch", "yaw"),
        **named(own.position, *"xyz"),
    }
    assert "body_rate" not in maps(proposed({"": columns}, "", units={"time": "s"}))


def test_motors_that_rest_at_minus_one_are_rotors(own):
    commands = 2 * (own.speed / own.speed.max()) ** 2 - 1
    commands[:600] = -1.0
    columns = {
        "time": own.time,
        **named(own.rate, "gyro_x", "gyro_y", "gyro_z"),
        **named(own.angles, "roll", "pitch", "yaw"),
        **named(commands, *(f"motor_{number}" for number in range(1, 5))),
    }
    assert "rotor_command" in maps(proposed({"": columns}, "", units={"time": "s"}))


def test_numbers_that_no_parrot_counts_are_not_taken_for_its_own(own):
    columns = {
        "time": own.time,
        **named(own.angles, *(f"rt_yout/{axis}" for axis in ("roll", "pitch", "yaw"))),
        **named(own.rate, "gyro_x", "gyro_y", "gyro_z"),
        **named(1000 + 1000 * (own.speed / 1000) ** 2, *(f"rt_yout/motors[{motor}]" for motor in range(4))),
    }
    assert maps(proposed({"": columns}, "", units={"time": "s"}))["rotor_command"].scale == 1 / 1000
