"""`init` is never sure of what it cannot know: names that lie, columns that are odd, and what nothing decides."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.airframe import airframe_from_motion
from cpfls_cli.flightlog.attitude_columns import angle_unit, doubt_reading
from cpfls_cli.flightlog.names import column_groups, named_signals
from cpfls_cli.flightlog.proposal import known_log, propose
from cpfls_cli.flightlog.recognised import LogTable, Seen
from tests.builders.unknown_logs import FLIP, GRAVITY, HUBS, NED, flat_log, flight, named, quaternion, with_ground

GYRO, ACC = ("gyro_x", "gyro_y", "gyro_z"), ("acc_x", "acc_y", "acc_z")
PLACE, SPEED, Q = ("x", "y", "z"), ("vx", "vy", "vz"), ("qw", "qx", "qy", "qz")
ANGLES = ("roll", "pitch", "yaw")
RPM = 60 / (2 * np.pi)
NAMES = {(1, -1): "front right", (-1, 1): "rear left", (1, 1): "front left", (-1, -1): "rear right"}
OWN, LONGER = flight(seconds=20.0), flight()
UP_DOWN = np.array([1.0, 1.0, -1.0])


def proposed(own=OWN, **changed):
    log = flat_log(own, **changed)
    return propose([known_log("log", log.topics, log.units, log.parameters, log.system)], None, None)


def choices(proposal):
    return {choice.key: (choice.value, choice.sure) for choice in proposal.choices}


def signal(proposal, name):
    return next(guess for guess in proposal.signals if guess.signal == name)


def assert_the_rest_is_as_named(proposal, *odd):
    """Everything but what is odd keeps its columns, its signs and FLU in ENU, and the rotors their corners."""
    assert choices(proposal)["body_frame"] == ("FLU", "data")
    assert choices(proposal)["world_frame"] == ("ENU", "data")
    for guess in proposal.signals:
        if guess.signal not in odd:
            assert guess.columns.sign is None, guess
    assert [(rotor.name, rotor.spin) for rotor in proposal.airframe.rotors] == [
        (NAMES[hub[:2]], hub[2]) for hub in HUBS
    ]


@pytest.mark.parametrize(
    ("changed", "odd", "sign", "said"),
    [
        ({"position": named(OWN.position * UP_DOWN, *PLACE)}, "position", UP_DOWN, "*: z is opposite to all others"),
        ({"position": named(OWN.position * [-1, 1, 1], *PLACE)}, "position", [-1, 1, 1], "*: x is opposite"),
        ({"velocity": named(OWN.velocity * UP_DOWN, *SPEED)}, "velocity", UP_DOWN, "v*: vz is opposite to all others"),
        ({"rate": named(OWN.rate * [1, -1, 1], *GYRO)}, "body_rate", [1, -1, 1], "gyro_*: gyro_y is opposite"),
        ({"attitude": named(OWN.angles * [-1, 1, 1], *ANGLES)}, "attitude", [-1, 1, 1], ""),
    ],
)
def test_one_column_against_all_others_is_the_odd_one_and_said(changed, odd, sign, said):
    proposal = proposed(**changed)
    assert_the_rest_is_as_named(proposal, odd)
    assert signal(proposal, odd).columns.sign == tuple(sign)
    assert any(said in warning for warning in proposal.warnings) or not said


def test_a_gyroscope_in_frd_does_not_turn_the_vehicle():
    proposal = proposed(rate=named(OWN.rate @ FLIP, *GYRO))
    assert_the_rest_is_as_named(proposal, "body_rate")
    assert signal(proposal, "body_rate").columns.sign == (1.0, -1.0, -1.0)


def test_an_altitude_in_a_log_of_frd_and_ned_turns_nothing():
    proposal = proposed(
        attitude=named(quaternion(Rotation.from_matrix(NED @ OWN.rotation.as_matrix() @ FLIP)), *Q),
        rate=named(OWN.rate @ FLIP, *GYRO),
        force=named(OWN.specific_force @ FLIP, *ACC),
        position=named(OWN.position @ NED.T * UP_DOWN, *PLACE),
        velocity=named(OWN.velocity @ NED.T, *SPEED),
    )
    assert choices(proposal)["body_frame"] == ("FRD", "data")
    assert choices(proposal)["world_frame"] == ("NED", "data")
    assert signal(proposal, "position").columns.sign == tuple(UP_DOWN)
    assert signal(proposal, "velocity").columns.sign is None


def test_without_an_accelerometer_an_odd_altitude_and_a_turned_log_are_both_possible():
    proposal = proposed(position=named(OWN.position * UP_DOWN, *PLACE), velocity=None, force=None)
    assert choices(proposal)["body_frame"] == ("FLU", "guess")
    (rival,) = next(choice for choice in proposal.choices if choice.key == "body_frame").rivals
    assert rival.text == "body_frame: FRD"
    assert "a flight with one known lean, turn or climb" in rival.reason
    # Left is right in the other reading, so the rotors are asked for.
    assert proposal.airframe.is_guess


@pytest.mark.parametrize(
    ("columns", "held"),
    [
        ([1, 2, 3, 0], "qz, qw, qx, qy"),
        ([0, 1, 3, 2], "qw, qx, qz, qy"),
        ([0, 2, 1, 3], "qw, qy, qx, qz"),
        ([0, 3, 2, 1], "qw, qz, qy, qx"),
    ],
)
def test_a_quaternion_whose_names_and_columns_disagree_is_put_in_order_and_said(columns, held):
    proposal = proposed(attitude=named(quaternion(OWN.rotation)[:, columns], *Q))
    assert_the_rest_is_as_named(proposal)
    assert ", ".join(signal(proposal, "quaternion").columns.columns) == held
    assert f"log: {held} are taken for w, x, y, z: this way the log agrees with itself; as named it does not" in (
        proposal.warnings
    )


def test_a_quaternion_that_needs_much_explaining_is_a_guess_and_so_is_all_that_hangs_on_it():
    proposal = proposed(attitude=named(quaternion(OWN.rotation)[:, [2, 3, 0, 1]], *Q))
    assert {signal(proposal, name).sure for name in ("quaternion", "body_rate")} == {"guess"}
    assert choices(proposal)["body_frame"][1] == "guess"
    assert proposal.airframe.is_guess


@pytest.mark.parametrize(
    ("ending", "unit", "scale", "factor"),
    [
        ("_rad_s", "rad/s", 1.0, 1.0),
        ("_radps", "rad/s", 1.0, 1.0),
        ("[rad/s]", "rad/s", 1.0, 1.0),
        (" (rad/s)", "rad/s", 1.0, 1.0),
        ("_rad_per_s", "rad/s", 1.0, 1.0),
        ("RadPerSec", "rad/s", 1.0, 1.0),
        ("_krpm", "rpm", 1e3, RPM / 1e3),
        ("_hz", "rad/s", 2 * np.pi, 1 / (2 * np.pi)),
        ("_deg_s", "deg/s", 1.0, np.degrees(1.0)),
    ],
)
def test_a_unit_in_a_name_shows_more_than_a_range(ending, unit, scale, factor):
    names = [f"m{number}{ending}" for number in range(1, 5)]
    guess = signal(proposed(speed=named(OWN.speed * factor, *names)), "rotor_speed")
    assert (guess.columns.unit, guess.columns.scale, guess.sure) == (unit, pytest.approx(scale), "named")


@pytest.mark.parametrize(
    ("name", "part", "columns", "unit", "scale"),
    [
        ("body_rate", "rate", [f"{axis}_mdps" for axis in GYRO], "deg/s", 1e-3),
        ("acceleration", "force", [f"{axis}[m/s^2]" for axis in ACC], "m/s^2", 1.0),
        ("acceleration", "force", [f"{axis}_mg" for axis in ACC], "g", 1e-3),
        ("position", "position", [f"pos_{axis}_cm" for axis in "xyz"], "m", 1e-2),
        ("velocity", "velocity", [f"v{axis}_mm_s" for axis in "xyz"], "mm/s", 1.0),
        ("attitude", "attitude", [f"{axis}_mrad" for axis in ANGLES], "rad", 1e-3),
    ],
)
def test_a_unit_is_read_however_it_is_written(name, part, columns, unit, scale):
    values = {"rate": OWN.rate * np.degrees(1.0), "force": OWN.specific_force, "position": OWN.position}
    values |= {"velocity": OWN.velocity, "attitude": OWN.angles}
    if unit == "g":
        values["force"] = OWN.specific_force / GRAVITY
    factor = 1e3 if unit == "mm/s" else 1 / scale
    proposal = proposed(**{part: named(values[part] * factor, *columns)})
    assert (signal(proposal, name).columns.unit, signal(proposal, name).columns.scale) == (unit, pytest.approx(scale))
    assert proposal.warnings == ()


@pytest.mark.parametrize(
    ("name", "changed", "unit", "said"),
    [
        (
            "attitude",
            {"attitude": named(np.degrees(OWN.angles), "roll_rad", "pitch_rad", "yaw_rad")},
            "deg",
            "said to be in rad; its size says deg",
        ),
        (
            "position",
            {"position": named(1e3 * OWN.position, "pos_x_m", "pos_y_m", "pos_z_m")},
            "mm",
            "said to be in m; judged by tilt and gravity, it is in mm",
        ),
        (
            "acceleration",
            {"force": named(OWN.specific_force / GRAVITY, "acc_x_m_s2", "acc_y_m_s2", "acc_z_m_s2")},
            "g",
            "said to be in m/s^2; its size says g",
        ),
    ],
)
def test_a_unit_that_is_stated_wrong_is_said_by_the_motion_and_said(name, changed, unit, said):
    proposal = proposed(**changed)
    assert signal(proposal, name).columns.unit == unit
    assert any(said in warning for warning in proposal.warnings)


@pytest.mark.parametrize("names", ["m", "motor", "u"])
def test_numbers_that_may_be_speeds_are_no_sure_command(names):
    guess = signal(proposed(speed=named(OWN.speed * RPM, *(f"{names}{n}" for n in range(1, 5)))), "rotor_command")
    assert guess.sure == "guess"
    assert [rival.text for rival in guess.rivals] == ["unit: rad/s", "unit: rpm"]


def test_gravity_that_points_the_wrong_way_is_a_guess_with_its_rivals():
    guess = signal(proposed(force=named(OWN.specific_force * UP_DOWN, *ACC)), "acceleration")
    assert guess.sure == "guess"
    assert [rival.text for rival in guess.rivals] == ["sign: [1, -1, -1]", "sign: [1, 1, -1]"]


def test_an_accelerometer_alone_may_log_gravity():
    proposal = proposed(attitude=None, position=None, velocity=None, force=named(OWN.specific_force @ FLIP, *ACC))
    assert choices(proposal)["body_frame"] == ("FRD", "guess")


def test_what_is_chosen_is_no_rival_of_itself():
    """The accelerometer has chosen FRD, and the attitude can be read as of either."""
    log = flat_log(OWN)
    seen = Seen(LogTable(log.topics, log.units), {}, slice(None), None)
    seen.choose("body_frame", "FRD", "by the accelerometer", "guess")
    seen.choose("world_frame", "NED", "as the body", "guess")
    best, other = (
        SimpleNamespace(attitude=SimpleNamespace(order=(0, 1, 2)), maps={}, body=body, world=world)
        for body, world in (("FLU", "ENU"), ("FRD", "NED"))
    )
    doubt_reading(seen, SimpleNamespace(best=best, tied=(other,)))
    rivals = {key: [rival.text for rival in choice.rivals] for key, choice in seen.choices.items()}
    assert rivals == {"body_frame": ["body_frame: FLU"], "world_frame": ["world_frame: ENU"]}


@pytest.mark.parametrize(
    ("columns", "said"), [([0, 1, 1], "gyro_y and gyro_z have the same values"), ([0, 1, 3], "gyro_z never changes")]
)
def test_a_column_that_is_another_one_or_nothing_makes_a_guess(columns, said):
    proposal = proposed(rate=named(np.column_stack([OWN.rate, np.zeros(len(OWN.time))])[:, columns], *GYRO))
    assert signal(proposal, "body_rate").sure == "guess"
    assert any(said in warning for warning in proposal.warnings)


def test_a_gyroscope_of_another_flight_is_a_guess():
    proposal = proposed(rate=named(flight(seconds=20.0, seed=9).rate, *GYRO))
    assert signal(proposal, "body_rate").sure == "guess"
    assert any("the derivative of the attitude explains only" in warning for warning in proposal.warnings)


def test_three_of_four_rotors_are_a_guess():
    speed = OWN.speed.copy()
    speed[:, 3] = 570.0
    guess = signal(proposed(speed=named(speed * RPM, "rpm1", "rpm2", "rpm3", "rpm4")), "rotor_speed")
    assert (guess.sure, guess.rivals[0].text) == ("guess", "columns: [rpm1, rpm2, rpm3, rpm4]")


@pytest.mark.parametrize(
    ("stamps", "said"),
    [
        (np.arange(len(LONGER.time)) * 1.0, "t rises by 1 from row to row"),
        (1e4 * LONGER.time, "which no unit explains: is the unit of the stamps right?"),
    ],
)
def test_stamps_that_count_something_else_are_doubted(stamps, said):
    assert any(said in warning for warning in proposed(LONGER, t={"t": stamps}).warnings)


def test_a_log_that_is_short_if_its_stamps_count_nothing_else_says_so():
    short = flight(seconds=15.0)
    with pytest.raises(InputError, match=r"holds only 1.5 s; .* at least ten; t rises by 1 from row to row"):
        proposed(short, t={"t": np.arange(len(short.time)) * 1.0})


def test_a_layout_in_which_single_rotors_push_the_wrong_way_is_no_known_one():
    """Columns of rotors that are apart in time explain a part of a lively flight in a layout that is none."""
    lively = flight(angle=0.05, highest_hz=4.0, climb=2.0)
    apart = [np.column_stack([np.roll(lively.speed[:, rotor], step * rotor) for rotor in range(4)]) for step in (0, 5)]
    together, late = (airframe_from_motion(lively.rate, speed, 100.0, False) for speed in apart)
    assert together.clear
    assert max(late.explained[:2]) > 0.3
    assert not late.clear


def test_a_flight_in_a_plane_turns_no_axis():
    # An airplane that climbs with more throttle gets faster with its nose up, as no rotor above it would have it.
    time = np.arange(0.0, 30.0, 0.02)
    pitch = 0.2 * np.sin(1.1 * time) + 0.1 * np.sin(2.3 * time)
    velocity = np.column_stack([12.0 - 3.0 * np.cos(1.1 * time), 0 * time, -2.0 * np.sin(1.1 * time)])
    still = np.zeros_like(time)
    force = np.column_stack([np.gradient(velocity[:, 0], time), still, np.full_like(time, -GRAVITY)])
    log = {
        "t": {"t": time},
        "q": named(np.column_stack([np.cos(pitch / 2), still, np.sin(pitch / 2), still]), *Q),
        "rate": named(np.column_stack([still, np.gradient(pitch, time), still]), *GYRO),
        "force": named(force, *ACC),
        "velocity": named(velocity, *SPEED),
    }
    own = {name: values for part in log.values() for name, values in part.items()}
    proposal = propose([known_log("log", {"": own}, {}, {}, "")], None, None)
    assert signal(proposal, "velocity").columns.sign is None
    assert all(guess.columns.sign is None for guess in proposal.signals)
    assert not any("opposite" in warning for warning in proposal.warnings)


def test_axes_that_an_autopilot_states_are_not_turned():
    topics = {
        "vehicle_local_position": {
            "timestamp": OWN.time,
            **named(OWN.position @ NED.T, *PLACE),
            **named(OWN.velocity @ NED.T * UP_DOWN, *SPEED),
        },
        "vehicle_angular_velocity": {"timestamp": OWN.time, **named(OWN.rate @ FLIP, "xyz[0]", "xyz[1]", "xyz[2]")},
    }
    log = known_log("log", topics, {}, {}, "PX4 1.14.0")
    assert log.recognition.signal("velocity").columns.sign is None
    assert not any("opposite" in warning for warning in log.recognition.warnings)


def test_outputs_that_swing_against_the_rotors_are_no_rotors_for_sure():
    pulses = 1000.0 + 1000.0 * OWN.speed / OWN.speed.max()
    elevons = 1500.0 + 600.0 * OWN.angles[:, 1:2] + 900.0 * OWN.angles[:, :1] * [1, -1]
    speed = named(np.hstack([pulses, elevons]), *(f"actuator_outputs[{index}]" for index in range(6)))
    proposal = proposed(speed=speed)
    rotors = signal(proposal, "rotor_command")
    assert rotors.columns.columns == tuple(f"actuator_outputs[{index}]" for index in range(4))
    assert rotors.sure == "guess"
    assert "actuator_outputs[4] and actuator_outputs[5]" in rotors.rivals[0].reason
    assert proposal.logs[0].recognition.load is None
    assert proposal.airframe is None or proposal.airframe.is_guess


def test_six_rotors_of_a_hexarotor_in_hover_are_all_rotors():
    rng = np.random.default_rng(2)
    turns = np.linspace(0, 2 * np.pi, 6, endpoint=False) + np.pi / 6
    mixed = np.column_stack([0.05 * np.ones(6), np.sin(turns), 0.1 * np.cos(turns), 0.1 * (-1) ** np.arange(6)])
    pulses = 1500.0 + 60.0 * (OWN.angles @ mixed[:, 1:].T) + 2.0 * rng.standard_normal((len(OWN.time), 6))
    speed = named(pulses, *(f"actuator_outputs[{index}]" for index in range(6)))
    assert proposed(speed=speed).rotors == 6


def test_angles_that_jump_by_a_full_turn_are_in_rad():
    """Who rolls over leans beyond a quarter turn, which else shows degrees."""
    (angles,) = (own for own in named_signals(column_groups(("roll", "pitch", "yaw"))) if own.signal == "attitude")
    time = np.linspace(0, 10, 1001)
    rolls = np.column_stack([np.angle(np.exp(1j * 3 * time)), 0.2 * np.sin(time), 0.1 * time])
    assert angle_unit(angles, rolls, time)[0] == "rad"
    assert angle_unit(angles, np.degrees(rolls), time)[0] == "deg"
    assert angle_unit(angles, np.column_stack([3.0 * np.sin(time), np.sin(time), time]), time)[0] == "deg"


def test_who_turns_thrice_a_second_turns_in_degrees():
    (angles,) = (own for own in named_signals(column_groups(("roll", "pitch", "yaw"))) if own.signal == "attitude")
    time = np.linspace(0, 10, 1001)
    level = np.zeros((1001, 2))
    assert angle_unit(angles, np.column_stack([level, 18.0 * np.clip(time - 5, 0, 5)]), time)[0] == "deg"
    unit, _, _, rivals = angle_unit(angles, np.column_stack([level, 2.0 * time]), time)
    assert (unit, len(rivals)) == ("rad", 1)


@pytest.mark.parametrize(("name", "factor", "unit"), [("Tiempo", 1.0, "s"), ("currentT", 1e6, "us")])
def test_what_alone_rises_evenly_is_the_clock_and_said_to_be(name, factor, unit):
    proposal = proposed(t={name: factor * OWN.time, "step": np.arange(len(OWN.time), dtype=float)})
    assert (proposal.time_column, proposal.time_unit) == (name, unit)
    assert any(f"{name} alone rises evenly" in words for words in proposal.warnings)


@pytest.mark.parametrize(
    "others",
    [
        {},
        {"Tiempo": 2.5 * OWN.time, "Uhr": 0.3 * OWN.time},
        {"loopIteration": 400 * OWN.time},
        {"Distance": 5 * OWN.time},
        {"x_ref": OWN.time},
        {"battery_mah": OWN.time},
        {"Tiempo_deg": OWN.time},
    ],
)
def test_what_is_counted_or_means_another_thing_and_two_that_rise_are_no_clock(others):
    others = {name: np.round(values, 6) for name, values in others.items()}
    if "x_ref" in others:
        others |= dict.fromkeys(("y_ref", "z_ref"), np.sin(OWN.time))
    rising = {"step": np.arange(len(OWN.time), dtype=float), **others}
    # The rows themselves are timed by the motion, where it shows how often they come.
    assert proposed(t=rising).time_column == f"row / {1 / OWN.time[1]:g}"
    with pytest.raises(InputError, match="no column of time stamps is recognised"):
        proposed(t=rising, attitude=None)


def test_logs_of_one_logger_without_stamps_have_one_clock():
    one, other, slower = (
        known_log(f"{factor}.csv", log.topics, log.units, log.parameters, log.system)
        for factor in (1.0, 0.95, 0.5)
        for log in [flat_log(OWN, t=None, rate=named(factor * OWN.rate, "gyro_x", "gyro_y", "gyro_z"))]
    )
    assert other.recognition.time_column != one.recognition.time_column
    assert propose([one, other], None, None).time_column == one.recognition.time_column
    with pytest.raises(InputError, match="the stamps are row / 100 in s and row / 50 in s, so one config cannot suit"):
        propose([one, slower], None, None)


def test_charge_is_no_voltage():
    level = np.round(np.linspace(42, 40, len(OWN.time)))
    assert "voltage" not in {guess.signal for guess in proposed(battery={"battery": level}).signals}
    proposal = proposed(battery={"battery": level, "battery_voltage": np.linspace(16.2, 15.4, len(OWN.time))})
    assert signal(proposal, "voltage").columns.columns == ("battery_voltage",)


def test_rotors_by_place_are_taken_in_the_order_of_their_places():
    front_left_first = OWN.speed[:, [2, 0, 1, 3]] * RPM
    assert [
        rotor.name
        for rotor in proposed(speed=named(front_left_first, "rpm_fl", "rpm_fr", "rpm_rl", "rpm_rr")).airframe.rotors
    ] == ["front left", "front right", "rear left", "rear right"]


def test_north_east_down_need_no_motion_to_count_downward():
    """A climb from the ground in z down; an attitude and places alone."""
    own = with_ground(OWN)
    turned = Rotation.from_matrix(NED @ own.rotation.as_matrix() @ FLIP)
    proposal = proposed(
        own,
        attitude=named(turned.as_euler("ZYX")[:, ::-1], *ANGLES),
        position=named(own.position @ NED.T, "pos_n", "pos_e", "pos_d"),
        velocity=named(own.velocity @ NED.T, "vel_n", "vel_e", "vel_d"),
        rate=None,
        force=None,
        speed=None,
    )
    assert signal(proposal, "position").columns.columns == ("pos_n", "pos_e", "pos_d")
    assert choices(proposal)["world_frame"][0] == "NED"


def test_a_height_alone_shows_what_flies():
    own = with_ground(OWN)
    log = {"position": None, "velocity": None, "rate": None, "force": None, "speed": None}
    with pytest.raises(InputError, match="holds attitude alone"):
        proposed(own, **log)
    proposal = proposed(own, **log, height={"Altitude": own.position[:, 2]})
    assert {guess.signal for guess in proposal.signals} == {"attitude"}


def test_a_table_of_an_airplane_is_said_to_be_one():
    air = {"airspeed": 15 + OWN.velocity[:, 0], "aoa": 0.1 * OWN.angles[:, 1]}
    with pytest.raises(InputError, match=r"an airplane \(airspeed and aoa\)"):
        proposed(speed=None, air=air)
    # With rotors it is a multirotor that measures the wind.
    assert proposed(air=air).airframe is not None


@pytest.mark.parametrize(("velocity", "taken"), [(True, True), (False, False)])
def test_axes_behind_an_unknown_word_are_a_place_where_the_velocity_is_their_derivative(velocity, taken):
    speed = named(OWN.velocity, "ext_vx", "ext_vy", "ext_vz") if velocity else None
    proposal = proposed(position=named(OWN.position, "ext_x", "ext_y", "ext_z"), velocity=speed)
    assert ("position" in {guess.signal for guess in proposal.signals}) == taken
    attitude = named(OWN.angles, "ext_roll", "ext_pitch", "ext_yaw")
    own = proposed(position=named(OWN.position, "ext_x", "ext_y", "ext_z"), velocity=None, attitude=attitude)
    assert "position" in {guess.signal for guess in own.signals}
    vibration = named(1 + OWN.angles, "vibe_x", "vibe_y", "vibe_z")
    assert "position" not in {guess.signal for guess in proposed(position=vibration).signals}


def test_sticks_with_the_names_of_angles_are_no_attitude():
    sticks = named(1500 + 300 * OWN.angles, "Roll", "Pitch", "Yaw")
    proposal = proposed(attitude=sticks, imu=named(OWN.angles, "IMU_Roll", "IMU_Pitch", "IMU_Yaw"))
    assert signal(proposal, "attitude").columns.columns == ("IMU_Roll", "IMU_Pitch", "IMU_Yaw")
