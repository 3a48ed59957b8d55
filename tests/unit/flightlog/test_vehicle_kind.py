"""What a log says it flies: what no rotors carry is refused with what it is, a VTOL is used where it hovers."""

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.stated_vehicle import VTOL, forward_flight, refuse_disarmed, refuse_other_vehicle

SURFACES = {"SERVO1_FUNCTION": 4.0, "SERVO2_FUNCTION": 19.0, "SERVO3_FUNCTION": 70.0, "SERVO4_FUNCTION": 21.0}
MOTORS = {f"SERVO{output}_FUNCTION": 32.0 + output for output in range(1, 5)}


def status(**fields):
    values = {name: np.asarray(own, dtype=float) for name, own in fields.items()}
    return {"vehicle_status": {"timestamp": np.arange(len(next(iter(values.values()))), dtype=float), **values}}


def columns(*names):
    return {"": dict.fromkeys(names, np.zeros(2))}


@pytest.mark.parametrize(
    ("system", "parameters", "topics", "what"),
    [
        ("ArduPlane 4.3.7", {"Q_ENABLE": 0.0}, {}, "an airplane"),
        ("ArduPlane 3.1.2beta1", {}, {}, "an airplane"),
        ("ArduRover 2.46beta2", {"FRAME_CLASS": 1.0}, {}, "a ground vehicle or a boat"),
        ("ArduSub 4.1", {"FRAME_CLASS": 1.0}, {}, "a submarine"),
        ("ArduCopter 4.5", {"FRAME_CLASS": 6.0}, {}, "a helicopter"),
        ("ArduCopter 3.2", {"H_COL_MIN": 1250.0}, {}, "a helicopter"),
        ("", SURFACES, {}, "an airplane"),
        ("", {"RC1_FUNCTION": 77.0, "RC2_FUNCTION": 78.0}, {}, "an airplane"),
        ("", {"SERVO1_FUNCTION": 26.0, "SERVO3_FUNCTION": 73.0}, {}, "a ground vehicle"),
        ("PX4 1.13.0", {"MAV_TYPE": 1.0}, {}, "an airplane"),
        ("PX4 1.15.0", {"MAV_TYPE": 2.0, "CA_AIRFRAME": 6.0}, {}, "a ground vehicle"),
        ("PX4 1.10.0", {"SYS_AUTOSTART": 2106.0}, {}, "an airplane"),
        ("PX4 1.10.0", {"SYS_AUTOSTART": 16001.0}, {}, "a helicopter"),
        ("PX4 1.10.0", {"SYS_AUTOSTART": 50003.0}, {}, "a ground vehicle"),
        ("PX4 1.12.0", {}, status(vehicle_type=[2, 2]), "an airplane"),
        ("PX4 1.9.0", {}, status(is_rotary_wing=[0, 0], is_vtol=[0, 0]), "something without rotors that carry it"),
        ("Rotorflight 4.3.0", {}, {}, "a helicopter"),
        ("INAV 7.1.0", {"platform_type": "AIRPLANE"}, {}, "an airplane"),
        ("INAV 7.1.0", {}, columns("fwAltP", "motor[0]"), "an airplane"),
        ("ArduRocket 4.6.1", {}, {"CTUN": {"NavRoll": np.zeros(2)}}, "an airplane or its like"),
        ("Betaflight 4.4.0", {"mixer": 14.0}, {}, "an airplane"),
        ("Betaflight 4.4.0", {}, columns("gyroADC[0]", "motor[0]", "servo[3]"), "an airplane or its like"),
    ],
)
def test_what_no_rotors_carry_is_refused_with_what_it_is(system, parameters, topics, what):
    with pytest.raises(InputError, match=f"a log of {what} "):
        refuse_other_vehicle(topics, parameters, system)


@pytest.mark.parametrize(
    ("system", "parameters", "topics"),
    [
        ("ArduCopter 4.5", {"FRAME_CLASS": 1.0, **MOTORS, "SERVO9_FUNCTION": 7.0}, {}),
        ("ArduCopter 3.3", {"FRAME": 1.0, "RC7_FUNCTION": 10.0}, {}),
        ("ArduOther 4.5", {}, {"CTUN": {"NavRoll": np.zeros(2)}, "QTUN": {"ThO": np.zeros(2)}}),
        ("PX4 1.15.0", {"MAV_TYPE": 13.0, "SYS_AUTOSTART": 6001.0, "CA_AIRFRAME": 0.0}, status(vehicle_type=[1, 1])),
        ("Betaflight 4.4.0", {}, columns("gyroADC[0]", *(f"motor[{n}]" for n in range(4)))),
        ("", {}, {}),
    ],
)
def test_a_multirotor_is_none_of_them(system, parameters, topics):
    assert refuse_other_vehicle(topics, parameters, system) is None


@pytest.mark.parametrize(
    ("system", "parameters", "topics"),
    [
        ("ArduPlane 4.3.7", {"Q_ENABLE": 1.0, **SURFACES}, {}),
        ("PX4 1.14.0", {"MAV_TYPE": 22.0}, {}),
        ("PX4 1.14.0", {"SYS_AUTOSTART": 13000.0}, {}),
        ("PX4 1.14.0", {}, status(is_vtol=[1, 1], vehicle_type=[1, 2])),
    ],
)
def test_a_vtol_hovers(system, parameters, topics):
    found = refuse_other_vehicle(topics, parameters, system)
    assert found is not None
    assert found.what == VTOL


def test_forward_flight_is_said_by_states_and_modes():
    grid = np.array([0.5, 1.5, 2.5])
    assert forward_flight(status(vehicle_type=[1, 2, 1]), grid).tolist() == [False, True, False]
    by_mode = forward_flight({"MODE": {"timestamp": np.arange(3.0), "Mode": np.array([18.0, 5.0, 19.0])}}, grid)
    assert by_mode.tolist() == [False, True, False]
    assert forward_flight({}, grid) is None


@pytest.mark.parametrize(
    ("topics", "refused"),
    [
        (status(arming_state=[1, 1, 1, 1]), True),
        (status(arming_state=[0, 1, 1, 1]), True),
        ({"actuator_armed": {"timestamp": np.arange(4.0), "armed": np.zeros(4)}}, True),
        (status(arming_state=[1, 1, 2, 1]), False),
        (status(arming_state=[1, 6, 6, 6]), False),
        # On its way back from a fault, of a younger version; nothing said; in words; and where two topics disagree.
        (status(arming_state=[1, 5, 5, 5]), False),
        (status(arming_state=[np.nan] * 4), False),
        ({"vehicle_status": {"timestamp": np.arange(4.0), "arming_state": np.array(["armed"] * 4)}}, False),
        (status(arming_state=[2] * 4) | {"actuator_armed": {"timestamp": np.arange(4.0), "armed": np.zeros(4)}}, False),
        (status(nav_state=[0, 0, 0, 0]), False),
        # Of another length than its stamps it says nothing, and what ends early, begins late or pauses not all.
        ({"vehicle_status": {"timestamp": np.array([0.0, 60.0]), "arming_state": np.ones(2)}}, False),
        ({"vehicle_status": {"timestamp": np.arange(4.0), "arming_state": np.ones(3)}}, False),
        (status(arming_state=[1, 1]) | {"sensor_gyro": {"timestamp": np.array([0.0, 60.0])}}, False),
        (status(arming_state=[1, 1]) | {"sensor_gyro": {"timestamp": np.array([-60.0, 1.0])}}, False),
        ({}, False),
    ],
)
def test_a_log_that_is_never_armed_is_no_flight(topics, refused):
    """What is carried by hand turns and rises as what flies does."""
    if refused:
        with pytest.raises(InputError, match="no flight in it: PX4 is not armed throughout"):
            refuse_disarmed(topics)
    else:
        refuse_disarmed(topics)
