"""What logs state of their vehicles, in what two of them differ, and what an autopilot is asked to log faster."""

import pytest

from cpfls_cli.flightlog.stated_vehicle import (
    autopilots_apart,
    log_faster,
    ranges_apart,
    stated_vehicle,
    vehicles_apart,
)

COPTER = {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0, "MOT_PWM_MAX": 2000.0}


def test_autopilot_frame_and_rotors_count_and_no_version_or_tuning():
    first = stated_vehicle("ArduCopter 3.6.8", COPTER)
    assert first == {
        "written by": "ArduCopter",
        "version": "3.6.8",
        **dict.fromkeys(COPTER, "1"),
        "MOT_PWM_MAX": "2000",
    }
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


RACER = {"Craft name": "Kestrel", "Board information": "ACME F405", "motorOutput": "48,2047", "motor_poles": 14.0}


def test_a_craft_has_a_name_and_poles_and_may_get_another_board():
    first = stated_vehicle("Betaflight 4.5.0 (abc) STM32F405", RACER)
    named = stated_vehicle("Betaflight 4.5.0 (abc) STM32F405", RACER | {"Craft name": "Merlin"})
    assert vehicles_apart(first, named) == ["Craft name Kestrel and Merlin"]
    assert vehicles_apart(first, stated_vehicle("Betaflight 4.5.0", RACER | {"motor_poles": 12.0}))
    # A name that nobody gave says nothing.
    new = RACER | {"Craft name": "", "Board information": "ACME F722", "motorOutput": "158,2047"}
    rebuilt = stated_vehicle("Betaflight 4.5.0 (abc) STM32F405", new)
    assert vehicles_apart(first, rebuilt) == []
    assert autopilots_apart(first, rebuilt) == [
        "Board information ACME F405 and ACME F722",
        "motorOutput 48,2047 and 158,2047",
    ]
    assert ranges_apart(first, rebuilt)


def test_an_old_frame_is_a_frame_type_and_throttle_is_an_output_where_nothing_else_is():
    old = stated_vehicle("ArduCopter 3.4.4", {"FRAME": 1.0, "RC3_MIN": 1100.0, "RC3_MAX": 1900.0})
    new = stated_vehicle("ArduCopter 3.6.8", {**COPTER, "MOT_PWM_MAX": 0.0, "RC3_MIN": 1101.0, "RC3_MAX": 1900.0})
    assert vehicles_apart(old, new) == []
    assert autopilots_apart(old, new) == ["version 3.4.4 and 3.6.8"]
    assert not ranges_apart(old, new)
    assert ranges_apart(old, new | {"RC3_MIN": "1130"})
    assert "FRAME_TYPE 1 and 0" in vehicles_apart(old, new | {"FRAME_TYPE": "0"})
    assert "RC3_MIN" not in stated_vehicle("PX4 1.14.0", {"RC3_MIN": 1100.0})
    assert "RC3_MIN" not in stated_vehicle("ArduCopter 3.6.8", {**COPTER, "RC3_MIN": 1100.0})


@pytest.mark.parametrize(
    ("system", "said", "unsaid"),
    [
        ("PX4 1.15.0", "log them at 100 Hz or more (PX4: SDLOG_PROFILE = 17", "LOG_BITMASK"),
        ("Betaflight 4.5.1 (77d01ba3b) STM32F405", "blackbox_sample_rate = 1/4", "p_ratio"),
        ("Betaflight 4.2.9 (e097f4ab7) STM32F7X2", "blackbox_p_ratio = 32", "sample_rate"),
        ("Betaflight 3.1.7", "blackbox_rate_num = 1", "p_ratio"),
        ("INAV 7.1.2", "blackbox_rate_num = 1", "p_ratio"),
        ("ArduPlane 4.5.7", "LOG_BITMASK with bit 0", "RCOU"),
        ("ArduCopter 4.5.7", "RATEMAX = 0 and LOG_BITMASK = 438271, which is 176126 with bits 0", "ArduPilot 4"),
        ("ArduCopter 3.6.8", "with bits 0 (fast attitude), 10 (outputs) and 18 (fast IMU", "RATEMAX"),
        ("ArduCopter 3.1.3", "LOG_BITMASK with bits 0 (fast attitude) and 10 (outputs)", "18 ("),
        ("ArduCopter", "LOG_BITMASK with bits 0 (fast attitude), 10", "RATEMAX"),
    ],
)
def test_settings_are_those_of_the_version(system, said, unsaid):
    words = log_faster("them", 100.0, system)
    assert said in words
    assert unsaid not in words
    assert ("at 100 Hz or more" in words) == ("RCOU" not in words), "outputs of ArduPilot are never that fast"


def test_the_log_s_own_mask_keeps_its_bits():
    words = log_faster("them", 100.0, "ArduCopter 3.1.3", parameters={"LOG_BITMASK": 958.0})
    assert "LOG_BITMASK = 1983, which is 958 with bits 0 (fast attitude) and 10 (outputs)" in words
    assert "for ArduCopter 3.1.3 logs outputs (RCOU) 10 times a second at most" in words
    without = log_faster("them", 100.0, "ArduCopter 3.1.3", parameters={"LOG_BITMASK": 958.0 - 128.0})
    assert "LOG_BITMASK = 1983, which is 830 with bits 0 (fast attitude), 7 (IMU) and 10 (outputs)" in without


def test_a_crazyflie_that_logs_fast_enough_gets_no_setting_that_slows_it():
    words = log_faster("the gyroscope", 200.0, "Crazyflie")
    assert words.startswith("log the gyroscope at 200 Hz or more")
    assert "period_in_ms = " not in words


def test_of_unknown_writers_nothing_is_named_and_of_known_ones_each_once():
    before_ulog = log_faster("rotors", 50.0, "PX4", parameters={"SDLOG_RATE": -1.0})
    assert before_ulog == "log rotors at 50 Hz or more (PX4: SDLOG_RATE = 200, then restart)"
    assert log_faster("rotors", 50.0, "ROS 2") == log_faster("rotors", 50.0) == "log rotors at 50 Hz or more"
    words = log_faster("rotors", 50.0, "PX4 1.14.3", "PX4 1.15.0", "ArduCopter 4.5.7")
    assert [words.count(name) for name in ("SDLOG_PROFILE", "LOG_BITMASK")] == [1, 1]
