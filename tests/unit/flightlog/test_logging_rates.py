"""What an autopilot is asked to log faster: parameters that its version has."""

import pytest

from cpfls_cli.flightlog.stated_vehicle import log_faster


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


def test_of_unknown_writers_nothing_is_named_and_of_known_ones_each_once():
    assert log_faster("rotors", 50.0, "ROS 2") == log_faster("rotors", 50.0) == "log rotors at 50 Hz or more"
    words = log_faster("rotors", 50.0, "PX4 1.14.3", "PX4 1.15.0", "ArduCopter 4.5.7")
    assert [words.count(name) for name in ("SDLOG_PROFILE", "LOG_BITMASK")] == [1, 1]
