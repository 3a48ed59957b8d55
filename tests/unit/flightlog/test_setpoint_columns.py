"""What kinds of logs say was asked for is recognised where the vehicle follows it; what is unclear is left out."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli.flightlog.names import column_groups, named_signals
from cpfls_cli.flightlog.proposal import known_log, propose
from cpfls_cli.flightlog.settings import SETPOINTS
from tests.builders.unknown_logs import FLIP, NED, flat_log, flight, named, quaternion

LATE = 10
"""Samples by which the vehicle follows, 0.1 s."""


@pytest.fixture(scope="module")
def own():
    return flight(seconds=20.0)


def ahead(values):
    """What was asked for, a tenth of a second before it was flown."""
    return np.vstack([values[LATE:], np.repeat(values[-1:], LATE, axis=0)])


@pytest.fixture(scope="module")
def asked(own):
    """Setpoints in FLU and ENU, and sticks as shares."""
    angles = ahead(own.angles)
    waves = np.sin(np.outer(own.time, np.random.default_rng(5).uniform(0.5, 3.0, 4)))
    return SimpleNamespace(
        angles=angles,
        rotation=Rotation.from_euler("ZYX", angles[:, ::-1]),
        rate=ahead(own.rate),
        position=ahead(own.position),
        velocity=ahead(own.velocity),
        thrust=0.4 + 0.1 * waves[:, 0],
        sticks=np.column_stack([0.8 * waves[:, :3], 0.2 + 0.3 * waves[:, 3]]),
    )


def topic(own, every, columns, late=0.0):
    """A topic that has a sample at every so many."""
    return {"timestamp": late + own.time[::every], **{name: values[::every] for name, values in columns.items()}}


def logs(topics, system, parameters=None, units=None):
    return [known_log("log", topics, units or {}, parameters or {}, system)]


def setpoints(proposal):
    return {guess.signal: guess for guess in proposal.signals if guess.signal in SETPOINTS}


def found(topics, system, **more):
    proposal = propose(logs(topics, system, **more), None, None)
    return setpoints(proposal), proposal


def px4(own, asked):
    turned, wished = (Rotation.from_matrix(NED @ r.as_matrix() @ FLIP) for r in (own.rotation, asked.rotation))
    nothing = np.full((len(own.time), 1), np.nan)
    return {
        "vehicle_attitude": topic(own, 2, named(quaternion(turned), *(f"q[{part}]" for part in range(4)))),
        "vehicle_angular_velocity": topic(own, 1, named(own.rate @ FLIP, *(f"xyz[{axis}]" for axis in range(3)))),
        "vehicle_local_position": topic(own, 5, named(own.position @ NED.T, "x", "y", "z"))
        | {name: values[::5] for name, values in named(own.velocity @ NED.T, "vx", "vy", "vz").items()},
        "actuator_motors": topic(own, 1, named((own.speed / 1000) ** 2, *(f"control[{rotor}]" for rotor in range(4)))),
        "vehicle_attitude_setpoint": topic(own, 5, named(quaternion(wished), *(f"q_d[{part}]" for part in range(4))))
        | {f"thrust_body[{axis}]": own[::5] for axis, own in enumerate(np.outer([0, 0, -1], asked.thrust))},
        "vehicle_rates_setpoint": topic(own, 2, named(asked.rate @ FLIP, "roll", "pitch", "yaw")),
        # Five times a second, as the logger has it by default.
        "trajectory_setpoint": topic(
            own, 20, named(asked.position @ NED.T, *(f"position[{axis}]" for axis in range(3))), late=0.003
        )
        | {f"velocity[{axis}]": nothing[::20, 0] for axis in range(3)},
        "manual_control_setpoint": topic(own, 20, named(asked.sticks, "roll", "pitch", "yaw", "throttle")),
    }


def test_setpoints_of_px4(own, asked):
    known, proposal = found(px4(own, asked), "PX4 1.15.0")
    assert list(known) == [
        *("setpoint_position", "setpoint_attitude", "setpoint_body_rate", "setpoint_thrust", "sticks")
    ]
    assert known["setpoint_attitude"].columns.columns == tuple(f"vehicle_attitude_setpoint.q_d[{i}]" for i in range(4))
    assert known["setpoint_attitude"].columns.unit == "1"
    assert known["setpoint_position"].columns.columns[2] == "trajectory_setpoint.position[2]"
    assert known["setpoint_thrust"].columns.columns == ("vehicle_attitude_setpoint.thrust_body[2]",)
    assert known["setpoint_thrust"].columns.sign == (-1.0,)
    assert known["sticks"].columns.columns[3] == "manual_control_setpoint.throttle"
    assert all(not guess.columns.required for guess in known.values())
    for name in ("setpoint_attitude", "setpoint_position", "setpoint_body_rate"):
        assert known[name].sure == "data", known[name].reason
        assert "follows it (correlation" in known[name].reason
    # Five setpoints a second make neither the clock nor the gaps of what is measured.
    assert proposal.first.slowest_s == pytest.approx(0.05)
    assert proposal.time_column in ("vehicle_angular_velocity.timestamp", "actuator_motors.timestamp")


def test_older_px4_calls_them_otherwise(own, asked):
    topics = px4(own, asked)
    topics["trajectory_setpoint"] = topic(own, 5, named(asked.position @ NED.T, "x", "y", "z"))
    topics["manual_control_setpoint"] = topic(own, 5, named(asked.sticks, "y", "x", "r", "z"))
    known, _ = found(topics, "PX4 1.12.3")
    assert known["setpoint_position"].columns.columns[0] == "trajectory_setpoint.x"
    assert known["sticks"].columns.columns == tuple(f"manual_control_setpoint.{axis}" for axis in "yxrz")


def test_setpoints_of_ardupilot_and_the_channels_of_its_sticks(own, asked):
    def degrees(rotation):
        angles = np.degrees(Rotation.from_matrix(NED @ rotation.as_matrix() @ FLIP).as_euler("ZYX")[:, ::-1])
        return (
            angles % [[1e9, 1e9, 360]]
            if (angles[:, :2] >= 0).all()
            else np.column_stack([*angles[:, :2].T, angles[:, 2] % 360])
        )

    pulses = named(1500 + 500 * asked.sticks[:, [1, 0, 2, 3]], "C1", "C2", "C3", "C4")
    position, velocity = asked.position @ NED.T, asked.velocity @ NED.T
    topics = {
        "ATT": topic(own, 4, named(degrees(own.rotation), "Roll", "Pitch", "Yaw"))
        | {k: v[::4] for k, v in named(degrees(asked.rotation), "DesRoll", "DesPitch", "DesYaw").items()},
        "IMU": topic(own, 1, named(own.rate @ FLIP, "GyrX", "GyrY", "GyrZ")),
        "RATE": topic(own, 2, named(np.degrees(asked.rate @ FLIP), "RDes", "PDes", "YDes")),
        "XKF1": topic(own, 10, named(own.position @ NED.T, "PN", "PE", "PD"))
        | {k: v[::10] for k, v in named(own.velocity @ NED.T, "VN", "VE", "VD").items()},
        "RCOU": topic(own, 2, named(1000 + own.speed, *(f"C{number}" for number in range(1, 5)))),
        "RCIN": topic(own, 10, pulses),
    }
    for axis, letter in enumerate("NED"):
        columns = {f"TP{letter}": position[:, axis], f"DV{letter}": velocity[:, axis]}
        topics[f"PSC{letter}"] = topic(own, 10, columns, late=0.001 * axis)
    parameters = {"RCMAP_ROLL": 2.0, "RCMAP_PITCH": 1.0, "RCMAP_YAW": 3.0, "RCMAP_THROTTLE": 4.0}
    known, _ = found(topics, "ArduCopter 4.5.1", parameters=parameters, units={"ATT.DesRoll": "deg"})
    assert set(known) == set(SETPOINTS) - {"setpoint_thrust"}
    assert known["setpoint_position"].columns.columns == ("PSCN.TPN", "PSCE.TPE", "PSCD.TPD")
    assert known["setpoint_velocity"].columns.columns == ("PSCN.DVN", "PSCE.DVE", "PSCD.DVD")
    assert known["setpoint_attitude"].columns.unit == "deg"
    assert known["setpoint_body_rate"].columns.unit == "deg/s"
    sticks = known["sticks"].columns
    assert sticks.columns == ("RCIN.C2", "RCIN.C1", "RCIN.C3", "RCIN.C4")
    mapped = sticks.scale * (1500 + 500 * asked.sticks[:, 0]) + sticks.offset
    assert mapped == pytest.approx(asked.sticks[:, 0])


def test_setpoints_of_betaflight(own, asked):
    columns = {
        "time": own.time,
        **named(np.degrees(own.rate), *(f"gyroADC[{axis}]" for axis in range(3))),
        **named(own.speed[:, [3, 0, 1, 2]] * 1.9 + 48, *(f"motor[{motor}]" for motor in range(4))),
        **named(np.degrees(asked.rate), *(f"setpoint[{axis}]" for axis in range(3))),
        "setpoint[3]": np.round(1000 * asked.thrust),
        **named(500 * asked.sticks[:, :3], *(f"rcCommand[{axis}]" for axis in range(3))),
        "rcCommand[3]": 1500 + 500 * asked.sticks[:, 3],
    }
    units = {"time": "s", **{f"{name}[{axis}]": "deg/s" for axis in range(3) for name in ("gyroADC", "setpoint")}}
    known, _ = found({"": columns}, "Betaflight 4.4.2", parameters={"motorOutput": "48,1948"}, units=units)
    assert set(known) == {"setpoint_body_rate", "setpoint_thrust", "sticks"}
    assert known["setpoint_body_rate"].sure == "data"
    assert known["setpoint_thrust"].columns.scale == pytest.approx(1e-3)
    assert len(known["sticks"].columns.columns) == 3
    # Ten times finer, and the header of no version says so: left out, and said.
    finer = columns | {name: 10 * own for name, own in columns.items() if name.startswith("rcCommand")}
    known, proposal = found({"": finer}, "Betaflight 4.4.2", parameters={"motorOutput": "48,1948"}, units=units)
    assert "sticks" not in known
    assert any("times full deflection" in words for words in proposal.first.left_out)


def crazyflie(own, asked, event="fixedFrequency."):
    nose_up = [[1.0, -1.0, 1.0]]
    return {
        f"{event}{name}": values
        for name, values in {
            **named(own.rotation.as_quat(), *(f"stateEstimate.q{part}" for part in "xyzw")),
            **named(np.degrees(own.rate), *(f"gyro.{axis}" for axis in "xyz")),
            **named(own.position, *(f"stateEstimate.{axis}" for axis in "xyz")),
            **named(asked.position, *(f"ctrltarget.{axis}" for axis in "xyz")),
            # What flies by position asks for no attitude, but its controller does.
            **named(np.zeros((len(own.time), 2)), "ctrltarget.roll", "ctrltarget.pitch"),
            "ctrltarget.yaw": np.degrees(asked.angles[:, 2]),
            **named(np.degrees(asked.angles) * nose_up, *(f"controller.{axis}" for axis in ("roll", "pitch", "yaw"))),
            **named(np.degrees(asked.rate) * nose_up, *(f"controller.{axis}Rate" for axis in ("roll", "pitch", "yaw"))),
        }.items()
    }


def test_setpoints_of_a_crazyflie(own, asked):
    topics = {"fixedFrequency": {"timestamp": own.time, **crazyflie(own, asked, event="")}}
    known, _ = found(topics, "Crazyflie uSD")
    assert set(known) == {"setpoint_position", "setpoint_attitude", "setpoint_body_rate"}
    assert known["setpoint_position"].columns.columns[0] == "fixedFrequency.ctrltarget.x"
    assert known["setpoint_attitude"].columns.columns[0] == "fixedFrequency.controller.roll"
    assert known["setpoint_attitude"].columns.sign == (1.0, -1.0, 1.0)
    assert {guess.sure for guess in known.values()} == {"data"}


def test_setpoints_of_a_crazyflie_whose_pitch_runs_the_other_way_are_left_out(own, asked):
    columns = crazyflie(own, asked, event="")
    columns["controller.pitch"] = -columns["controller.pitch"]
    del columns["ctrltarget.yaw"]
    known, proposal = found({"fixedFrequency": {"timestamp": own.time, **columns}}, "Crazyflie uSD")
    assert "setpoint_attitude" not in known
    assert any("the attitude runs against" in words for words in proposal.first.left_out)


def test_setpoints_of_mavros(own, asked):
    of_pose = ("pose.orientation.x", "pose.orientation.y", "pose.orientation.z", "pose.orientation.w")
    topics = {
        "/mavros/imu/data": topic(own, 1, named(own.rate, *(f"angular_velocity.{axis}" for axis in "xyz")))
        | named(own.rotation.as_quat(), *(f"orientation.{axis}" for axis in "xyzw")),
        "/mavros/local_position/pose": topic(own, 2, named(own.position, *(f"pose.position.{axis}" for axis in "xyz")))
        | {name: values[::2] for name, values in named(own.rotation.as_quat(), *of_pose).items()},
        "/mavros/setpoint_position/local": topic(
            own, 5, named(asked.position, *(f"pose.position.{axis}" for axis in "xyz"))
        ),
        "/mavros/setpoint_raw/target_attitude": topic(
            own, 2, named(asked.rotation.as_quat(), *(f"orientation.{axis}" for axis in "xyzw"))
        )
        | {k: v[::2] for k, v in named(asked.rate, *(f"body_rate.{axis}" for axis in "xyz")).items()}
        | {"thrust": asked.thrust[::2]},
    }
    known, proposal = found(topics, "ROS 2")
    assert known["setpoint_position"].columns.columns[0] == "/mavros/setpoint_position/local.pose.position.x"
    assert known["setpoint_attitude"].columns.columns[0] == "/mavros/setpoint_raw/target_attitude.orientation.w"
    assert known["setpoint_body_rate"].columns.columns[2] == "/mavros/setpoint_raw/target_attitude.body_rate.z"
    assert "setpoint_thrust" not in known
    assert any("commanded thrust, but in no stated unit" in words for words in proposal.first.left_out)


@pytest.mark.parametrize("word", ["{}_sp", "{}_des", "{}_setpoint", "target_{}", "{}_ref", "desired_{}"])
def test_columns_with_a_word_for_a_wish(own, asked, word):
    def written(values, *names):
        return named(values, *(word.format(name) for name in names))

    columns = flat_log(
        own,
        attitude_asked=written(np.degrees(asked.angles), "roll", "pitch", "yaw"),
        rate_asked=written(asked.rate, "p", "q", "r"),
        position_asked=written(1000 * asked.position, "x", "y", "z"),
        velocity_asked=written(asked.velocity, "vx", "vy", "vz"),
        thrust_asked={f"{word.format('thrust')} [N]": 8 * asked.thrust},
    ).topics
    known, proposal = found(columns, "")
    assert {name: guess.columns.unit for name, guess in known.items()} == {
        "setpoint_position": "mm",
        "setpoint_velocity": "m/s",
        "setpoint_attitude": "deg",
        "setpoint_body_rate": "rad/s",
        "setpoint_thrust": "N",
    }
    assert {own.sure for own in known.values()} == ({"guess", "named"} if "ref" in word else {"data", "named"})
    # No wish is a measurement.
    measured = {
        column for guess in proposal.signals if guess.signal not in SETPOINTS for column in guess.columns.columns
    }
    assert measured == {c for c in columns[""] if c not in {n for g in known.values() for n in g.columns.columns}} - {
        "t"
    }


def test_a_wish_that_runs_backward_is_turned_and_said(own, asked):
    columns = flat_log(own, wished=named(asked.angles * [1, -1, 1], "roll_sp", "pitch_sp", "yaw_sp")).topics
    known, _ = found(columns, "")
    assert known["setpoint_attitude"].columns.sign == (1.0, -1.0, 1.0)
    assert "with pitch_sp reversed" in known["setpoint_attitude"].reason


@pytest.mark.parametrize("kind", ["unlike", "too large", "of nothing"])
def test_what_is_unclear_is_left_out_and_said(own, asked, kind):
    wished = {
        "unlike": np.random.default_rng(7).standard_normal(asked.angles.shape).cumsum(axis=0) / 30,
        "too large": 7 * asked.angles,
        "of nothing": asked.velocity,
    }[kind]
    name = "v{}_sp" if kind == "of nothing" else "{}_sp"
    axes = ("x", "y", "z") if kind == "of nothing" else ("roll", "pitch", "yaw")
    columns = flat_log(own, velocity=None, wished=named(wished, *(name.format(axis) for axis in axes))).topics
    known, proposal = found(columns, "")
    assert known == {}
    said = {"unlike": "does not follow it", "too large": "which no unit explains", "of nothing": "to compare it with"}
    assert any(said[kind] in words for words in proposal.first.left_out), proposal.first.left_out


def test_an_axis_that_nothing_follows_makes_a_guess(own, asked):
    wished = asked.angles.copy()
    wished[:, 2] = np.random.default_rng(2).standard_normal(len(wished))
    known, _ = found(flat_log(own, wished=named(wished, "roll_sp", "pitch_sp", "yaw_sp")).topics, "")
    (rival,) = known["setpoint_attitude"].rivals
    assert known["setpoint_attitude"].sure == "guess"
    assert rival.reason == "the measured motion does not follow yaw_sp"


def test_words_for_a_wish_still_make_no_measurement():
    names = (
        "roll_sp",
        "pitch_sp",
        "yaw_sp",
        "p_des",
        "q_des",
        "r_des",
        "target_x",
        "target_y",
        "target_z",
        "thrust_sp",
    )
    assert named_signals(column_groups(names)) == ()


def test_logs_flown_in_other_modes_share_a_config(own, asked):
    """One by position, one by hand, one whose setpoint has another name: nothing of it is another vehicle."""
    plain = flat_log(own).topics[""]
    by_position = (
        plain | named(asked.position, "x_sp", "y_sp", "z_sp") | named(asked.angles, "roll_sp", "pitch_sp", "yaw_sp")
    )
    by_hand = plain | named(asked.position * [[1, -1, 1]], "x_sp", "y_sp", "z_sp")
    other = plain | named(asked.angles, "roll_des", "pitch_des", "yaw_des")
    known = [known_log(name, {"": c}, {}, {}, "") for name, c in (("a", by_position), ("b", by_hand), ("c", other))]
    found = setpoints(propose(known, None, None))
    attitude = found["setpoint_attitude"].columns
    assert not attitude.required
    assert [own.columns for own in attitude.otherwise] == [("roll_des", "pitch_des", "yaw_des")]
    assert found["setpoint_position"].sure == "guess"
    assert "what b follows" in [rival.reason for rival in found["setpoint_position"].rivals]


@pytest.mark.parametrize("crosses", [True, False])
def test_an_angle_is_followed_beyond_a_turn_and_chance_is_not(own, asked, crosses):
    """Round and round: what is asked for crosses half a turn at other times, or has nothing to do with it."""
    turning = SimpleNamespace(**vars(own))
    turning.angles = own.angles + np.outer(own.time, [0, 0, 1.0])
    turning.rotation = Rotation.from_euler("ZYX", turning.angles[:, ::-1])
    wished = asked.angles + np.outer(own.time, [0, 0, 1.0])
    wished[:, :2] = 0.0
    if not crosses:
        wished[:, 2] = 3.0 * np.random.default_rng(4).standard_normal(len(wished)).cumsum()
    wished[:, 2] = (wished[:, 2] + np.pi) % (2 * np.pi) - np.pi
    known, _ = found(flat_log(turning, rate=None, wished=named(wished, "roll_sp", "pitch_sp", "yaw_sp")).topics, "")
    assert ("setpoint_attitude" in known) == crosses


def test_short_moves_that_are_followed_are_setpoints(own):
    # Doublets of 80 ms, which a gyroscope that lags and is looked at slowly follows at a fraction of their size.
    time = np.arange(0.0, 30.0, 1e-3)
    asked = np.zeros((len(time), 3))
    for begin in np.arange(2.0, 28.0, 1.5):
        asked[(time >= begin) & (time < begin + 0.04), 0] = 200.0
        asked[(time >= begin + 0.04) & (time < begin + 0.08), 0] = -200.0
    rate = np.zeros_like(asked)
    for row in range(1, len(time)):
        rate[row] = rate[row - 1] + (asked[row - 1] - rate[row - 1]) / 15
    rate += np.random.default_rng(2).normal(0.0, 2.0, rate.shape)
    rate[:, 1] += 30.0 * np.sin(2.0 * time)
    speed = own.speed[(100 * time).astype(int) % len(own.time)]
    columns = {
        "time": time,
        **named(rate, *(f"gyroADC[{axis}]" for axis in range(3))),
        **named(asked, *(f"setpoint[{axis}]" for axis in range(3))),
        **named(speed * 1.9 + 48, *(f"motor[{motor}]" for motor in range(4))),
    }
    given, proposal = found(
        {"": columns}, "Betaflight 4.5.1", units={"time": "s"}, parameters={"motorOutput": "48,1948"}
    )
    assert "setpoint_body_rate" in given, proposal.left_out
