"""Which outputs drive motors, in which range, and where the motors of larger frames are."""

from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.airframe import stated_airframe, usual_airframe
from cpfls_cli.flightlog.proposal import known_log, propose
from cpfls_cli.flightlog.recognition import recognise
from cpfls_cli.flightlog.rotor_columns import _surfaces
from cpfls_cli.flightlog.stated_vehicle import LAYOUTS
from tests.builders.topic_logs import ardupilot, maps, proposed, topic
from tests.builders.unknown_logs import FLIP, flat_log, flight, named, quaternion, with_ground

X = {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0}
PWM = tuple(f"pwm{number}" for number in range(1, 5))


@pytest.fixture(scope="module")
def own():
    return with_ground(flight(seconds=20.0))


def copter(own, pulses, field="C"):
    """A log of a Copter with these outputs."""
    topics = ardupilot(own)
    names = (f"{field}{number}" for number in range(1, pulses.shape[1] + 1))
    return {name: topics[name] for name in ("ATT", "IMU")} | {"RCOU": topic(own, 2, named(pulses, *names))}


def pulses(own, *others, low=1000.0, high=2000.0):
    """Outputs of four motors, of 1000 rad/s at full command, and others next to them."""
    return np.column_stack([low + (high - low) * np.clip(own.speed / 1000, 0, 1), *others])


def knob(own):
    return np.choose((own.time // 7).astype(int) % 3, [1999.0, 1500.0, 1001.0])


def gimbal(own):
    return 1500 + 400 * own.angles[:, 0] + np.random.default_rng(1).normal(size=len(own.time))


@pytest.mark.parametrize("name", ["Ch", "Chan"])
def test_the_outputs_of_an_older_copter_are_rotors_in_the_form_of_its_frame(own, name):
    proposal = proposed(copter(own, pulses(own), name), "ArduCopter 3.3", {"FRAME": 1.0})
    assert maps(proposal)["rotor_command"].columns == tuple(f"RCOU.{name}{number}" for number in range(1, 5))
    assert not proposal.airframe.is_guess
    assert proposal.airframe.reason == "FRAME = 1 in the log: quad X"


@pytest.mark.parametrize("extra", [knob, gimbal])
@pytest.mark.parametrize(
    ("parameters", "why"),
    [
        ({"FRAME": 1.0}, "the frame has 4 motors"),
        ({"FRAME": 1.0, "RC5_FUNCTION": 7.0, "RC6_FUNCTION": 6.0}, "RC5_FUNCTION = 7: no motor"),
        (X, "the frame has 4 motors"),
        ({f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, 5)}, "no function of a motor"),
        ({}, "no motor"),
    ],
)
def test_a_camera_next_to_the_motors_is_no_rotor(own, extra, parameters, why):
    values = pulses(own, extra(own), gimbal(own)) if "RC6_FUNCTION" in parameters else pulses(own, extra(own))
    proposal = proposed(copter(own, values), "ArduCopter 3.4", parameters)
    assert maps(proposal)["rotor_command"].columns == ("RCOU.C1", "RCOU.C2", "RCOU.C3", "RCOU.C4")
    said = [words for words in proposal.first.left_out if words.startswith("RCOU.C5: it ")]
    assert len(said) == 1
    assert said[0].endswith(why) or "no motor" in said[0]


def test_a_landing_gear_of_a_log_of_unknown_kind_is_no_rotor(own):
    gear = np.where(own.time < 8, 1100.0, 1900.0)
    columns = named(pulses(own, gear), *(f"pwm{number}" for number in range(1, 6)))
    recognition = recognise(flat_log(own, speed=columns).topics, {}, {}, "")
    assert recognition.signal("rotor_command").columns.columns == PWM
    assert any(words.startswith("pwm5: it moves, but changes in") for words in recognition.left_out)


def test_outputs_that_stand_in_their_middle_before_take_off_are_no_rotors(own):
    swings = [300 * np.sin(rate * own.time) * (own.time > 5) for rate in (1.0, 0.7, 0.4)]
    throttle = np.where(own.time > 4, 1600 + 50 * np.sin(own.time), 1000.0)
    plane = named(np.column_stack([1500 + swings[0], 1500 + swings[1], throttle, 1500 + swings[2]]), *PWM)
    with pytest.raises(InputError, match=r"of an airplane or its like \(pwm1, pwm2, pwm3 and pwm4: before take-off"):
        recognise(flat_log(own, speed=plane).topics, {}, {}, "")
    # So do sticks; the motors of a log are found all the same.
    sticks = named(np.column_stack(list(plane.values())), *(f"servo{number}" for number in range(1, 5)))
    recognition = recognise(flat_log(own, speed={**sticks, **named(pulses(own), *PWM)}).topics, {}, {}, "")
    assert recognition.signal("rotor_command").columns.columns == PWM


def test_a_rotation_matrix_is_no_nine_rotors(own):
    matrix = own.rotation.as_matrix().reshape(-1, 9)
    flat = {"time": own.time} | named(matrix, *(f"R[{index}]" for index in range(9)))
    flat |= named(pulses(own), *PWM) | named(own.rate, *(f"w[{axis}]" for axis in range(3)))
    flat |= named(own.rotation.as_quat(), *(f"q[{index}]" for index in range(4)))
    assert maps(proposed({"": flat}, ""))["rotor_command"].columns == PWM


def test_outputs_that_begin_in_a_hover_are_no_surfaces(own):
    rising, falling = np.minimum(0.5, 0.1 * (own.time - 3)), np.maximum(-0.45, -0.1 * (own.time - 3))
    swings = [0.2 * np.sin(rate * (own.time - 3)) for rate in (1.0, 0.7)]
    moves = np.column_stack([rising, falling, *swings]) * (own.time > 3)[:, None]
    assert not _surfaces(own.time, 0.5 + moves)
    # A throttle that is off is the least of all outputs.
    assert _surfaces(own.time, 0.5 + moves - [0.5, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("parameters", "low", "high", "sure"),
    [
        ({"MOT_PWM_MIN": 1100.0, "MOT_PWM_MAX": 1900.0, "RC3_MIN": 1094.0, "RC3_MAX": 1934.0}, 1100, 1900, "named"),
        ({"MOT_PWM_MIN": 0.0, "MOT_PWM_MAX": 0.0, "RC3_MIN": 1094.0, "RC3_MAX": 1934.0}, 1094, 1934, "named"),
        ({"RC3_MIN": 1094.0, "RC3_MAX": 1934.0}, 1094, 1934, "named"),
        ({"RCMAP_THROTTLE": 2.0, "RC2_MIN": 1111.0, "RC2_MAX": 1888.0, "RC3_MIN": 1000.0}, 1111, 1888, "named"),
        ({}, 1000, 2000, "guess"),
    ],
)
def test_the_range_of_a_copter_is_that_of_its_motors_or_of_the_throttle_stick(own, parameters, low, high, sure):
    proposal = proposed(copter(own, pulses(own, low=low, high=high)), "ArduCopter 3.6.8", X | parameters)
    command = next(guess for guess in proposal.signals if guess.signal == "rotor_command")
    assert (command.columns.scale, command.columns.offset) == pytest.approx((1 / (high - low), -low / (high - low)))
    assert command.sure == sure


def two_sticks(own, *highest):
    topics = copter(own, pulses(own))
    return [
        known_log(f"{high:g}", topics, {}, X | {"RC3_MIN": 1094.0, "RC3_MAX": high}, "ArduCopter 3.6.8")
        for high in highest
    ]


def test_a_stick_that_is_calibrated_anew_makes_no_other_vehicle(own):
    rotors = maps(propose(two_sticks(own, 1934.0, 1933.0), None, None))["rotor_command"]
    assert (rotors.scale, rotors.offset) == pytest.approx((1 / 840, -1094 / 840))
    with pytest.raises(InputError, match=r"shares from 1094 to 1934 .* and .* shares from 1094 to 1900 "):
        propose(two_sticks(own, 1934.0, 1900.0), None, None)


def px4(own, instances, parameters):
    """A log of PX4 with outputs of one or two instances."""
    topics = {
        "vehicle_attitude": topic(own, 2, named(quaternion(own.rotation), *(f"q[{index}]" for index in range(4)))),
        "vehicle_angular_velocity": topic(own, 1, named(own.rate @ FLIP, *(f"xyz[{axis}]" for axis in range(3)))),
    }
    for number, values in enumerate(instances):
        names = (f"output[{index}]" for index in range(values.shape[1]))
        topics[f"actuator_outputs[{number}]" if number else "actuator_outputs"] = topic(own, 2, named(values, *names))
    return recognise(topics, {}, parameters, "PX4 1.14.0").signal("rotor_command").columns


def test_outputs_of_px4_are_motors_by_their_functions(own):
    four = pulses(own)
    mixed = np.column_stack([gimbal(own), four[:, 2], four[:, 0], four[:, 1], four[:, 3]])
    functions = {"PWM_AUX_FUNC1": 420.0} | {
        f"PWM_AUX_FUNC{output}": 101.0 + motor for output, motor in ((2, 2), (3, 0), (4, 1), (5, 3))
    }
    range_of_all = {
        f"PWM_AUX_{end}{output}": value for output in range(2, 6) for end, value in (("MIN", 1050), ("MAX", 1950))
    }
    found = px4(own, [mixed], functions | range_of_all)
    assert found.columns == tuple(f"actuator_outputs.output[{index}]" for index in (2, 3, 1, 4))
    assert (found.scale, found.offset) == pytest.approx((1 / 900, -1050 / 900))
    still = np.full((len(own.time), 8), 1500.0) + gimbal(own)[:, None] * np.eye(8)[0]
    found = px4(own, [still, mixed], functions)
    assert found.columns == tuple(f"actuator_outputs[1].output[{index}]" for index in (2, 3, 1, 4))


def test_a_range_of_pulses_is_not_that_of_outputs_by_dshot(own):
    parameters = {f"PWM_AUX_FUNC{n}": 100.0 + n for n in range(1, 5)}
    parameters |= {f"PWM_AUX_{end}{n}": value for n in range(1, 5) for end, value in (("MIN", 1100), ("MAX", 1900))}
    found = px4(own, [pulses(own, low=0.0, high=1500.0)], parameters)
    assert (found.scale, found.offset) == pytest.approx((1 / 2000, -48 / 2000))


def test_outputs_of_an_older_px4_are_as_many_motors_as_its_kind_of_vehicle_has(own):
    found = px4(own, [pulses(own, gimbal(own), gimbal(own) + 20)], {"MAV_TYPE": 2.0})
    assert found.columns == tuple(f"actuator_outputs.output[{index}]" for index in range(4))


def test_the_rotors_that_carry_an_older_vtol_of_px4_are_those_that_it_names(own):
    values = np.column_stack([gimbal(own), gimbal(own) + 9, pulses(own)])
    found = px4(own, [values], {"MAV_TYPE": 22.0, "VT_MOT_ID": 3456.0})
    assert found.columns == tuple(f"actuator_outputs.output[{index}]" for index in (2, 3, 4, 5))


@pytest.mark.parametrize("frame", LAYOUTS)
def test_rotors_of_a_known_frame_balance_and_control_each_axis(frame):
    places = np.array(LAYOUTS[frame])
    thrust, torques = np.ones(len(places)), np.array([places[:, 1], -places[:, 0], -places[:, 2]])
    assert places[:, 2].sum() == 0
    assert np.linalg.matrix_rank(np.vstack([thrust, torques])) == 4


@pytest.mark.parametrize(
    ("parameters", "first", "count"),
    [
        ({"FRAME_CLASS": 2.0, "FRAME_TYPE": 1.0}, ("right", -1), 6),
        ({"FRAME_CLASS": 4.0, "FRAME_TYPE": 1.0}, ("front right", 1), 8),
        ({"FRAME_CLASS": 5.0, "FRAME_TYPE": 1.0}, ("front right", 1), 6),
        ({"FRAME_CLASS": 5.0, "FRAME_TYPE": 10.0}, ("front right", -1), 6),
        ({"FRAME_CLASS": 12.0, "FRAME_TYPE": 1.0}, ("front right", 1), 12),
        ({"FRAME_CLASS": 14.0, "FRAME_TYPE": 0.0}, ("front", 1), 10),
        ({"Q_FRAME_CLASS": 1.0, "Q_FRAME_TYPE": 12.0}, ("rear right", -1), 4),
        ({"SYS_AUTOSTART": 6001.0}, ("right", -1), 6),
        ({"SYS_AUTOSTART": 12001.0}, ("front right", 1), 8),
        ({"SYS_AUTOSTART": 11001.0}, ("front right", -1), 6),
    ],
)
def test_frames_with_more_rotors_are_known_by_their_numbers(parameters, first, count):
    found = stated_airframe(parameters)
    assert (found.rotors[0].name, found.rotors[0].spin) == first
    assert (len(found.rotors), found.sure) == (count, "stated")


def test_the_form_of_a_frame_without_its_class_is_a_guess_where_another_class_has_as_many_motors():
    assert not stated_airframe({"FRAME": 1.0}, 4).is_guess
    assert stated_airframe({"FRAME": 1.0}, 6).is_guess
    assert not stated_airframe({"FRAME": 10.0}, 6).is_guess
    assert stated_airframe({"FRAME": 4.0}, 4) is None


def test_the_usual_order_of_a_kind_of_log_is_a_guess():
    assert usual_airframe("Betaflight", 6).is_guess
    assert not usual_airframe("Betaflight", 6).is_asked
    assert usual_airframe("Betaflight", 5) is None


def test_rotors_that_push_forward_are_none_that_carry():
    parameters = {"CA_ROTOR_COUNT": 5.0, "CA_ROTOR4_AZ": 0.0, "CA_ROTOR4_AX": 1.0}
    parameters |= {
        f"CA_ROTOR{index}_{key}": value
        for index, hub in enumerate(((1, 1, 1), (-1, -1, 1), (1, -1, -1), (-1, 1, -1)))
        for key, value in zip(("PX", "PY", "KM"), (0.2 * hub[0], 0.2 * hub[1], 0.05 * hub[2]), strict=True)
    }
    assert len(stated_airframe(parameters).rotors) == 4


def test_an_arm_never_rescales_places_that_a_log_states_unless_asked(own):
    parameters = {"CA_ROTOR_COUNT": 4.0} | {
        f"CA_ROTOR{index}_{key}": value
        for index, hub in enumerate(((1, 1, 1), (-1, -1, 1), (1, -1, -1), (-1, 1, -1)))
        for key, value in zip(("PX", "PY", "KM"), (0.15 * hub[0], 0.15 * hub[1], 0.05 * hub[2]), strict=True)
    }
    log = known_log("log", flat_log(own).topics, {}, parameters, "")
    (stated,) = {
        round(rotor.direction[0], 3) for rotor in propose([log], None, 0.215).airframe.rotors if rotor.direction[0] > 0
    }
    assert stated == 0.15
    with pytest.raises(InputError, match=r"--arm is 0.3 m, but CA_ROTOR.* put the rotors 0.212 m .*--scale-to-arm"):
        propose([log], None, 0.3)
    assert propose([log], None, 0.3, scale_to_arm=True).airframe.arm_m == pytest.approx(0.3)


def test_a_vtol_is_used_where_it_hovers(own):
    status = {
        "timestamp": np.array([0.0, 15.0, 21.0]),
        "is_vtol": np.ones(3),
        "vehicle_type": np.array([1.0, 2.0, 1.0]),
    }
    topics = ardupilot(own) | {"vehicle_status": status}
    flown = recognise(topics, {}, X, "ArduCopter 4.5").flown
    assert flown.span_s == pytest.approx((5.5, 15.0), abs=0.6)
    assert "its hover from" in flown.reasons[-1]
    known = known_log("log", topics, {}, X, "ArduCopter 4.5")
    with pytest.raises(InputError, match="flies on the wing for a part"):
        propose([known, known], None, None)
    forward = SimpleNamespace(**status | {"vehicle_type": np.full(3, 2.0)})
    with pytest.raises(InputError, match=r"a VTOL .*which is a multirotor in hover alone, and it hovers for 0 s"):
        recognise(topics | {"vehicle_status": vars(forward)}, {}, X, "ArduCopter 4.5")
