"""What logs state of their vehicles, and in what two of them differ."""

from cpfls_cli.flightlog.stated_vehicle import stated_vehicle, vehicles_apart

COPTER = {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0, "MOT_PWM_MAX": 2000.0}


def test_autopilot_frame_and_rotors_count_and_no_version_or_tuning():
    first = stated_vehicle("ArduCopter 3.6.8", COPTER)
    assert first == {"written by": "ArduCopter", "FRAME_CLASS": "1", "FRAME_TYPE": "1"}
    assert not vehicles_apart(first, stated_vehicle("ArduCopter 4.3.1", COPTER | {"MOT_PWM_MAX": 1900.0}))
    assert vehicles_apart(first, stated_vehicle("ArduCopter 4.3.1", COPTER | {"FRAME_CLASS": 2.0})) == [
        "FRAME_CLASS 1 and 2"
    ]
    assert vehicles_apart(first, stated_vehicle("PX4 1.14.0", {"CA_ROTOR0_PX": 0.1, "CA_ROTOR0_CT": 6.5})) == [
        "written by ArduCopter and PX4"
    ]
    assert vehicles_apart(first, stated_vehicle("", {})) == ["written by ArduCopter and something unknown"]


def test_what_states_nothing_is_not_apart():
    """Of a simulated flight nothing is known."""
    assert not vehicles_apart({}, stated_vehicle("PX4 1.14.0", {}))
