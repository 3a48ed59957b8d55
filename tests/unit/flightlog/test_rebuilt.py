"""Commands of rotors rebuilt from logs of simulated flights with thinned motors, and refused where they are wrong."""

import re
from functools import cache

import numpy as np
import pytest

from cpfls_cli.flightlog.rebuilt import rebuilt_rotors
from tests.builders.thinned_logs import AP, CA, COPTER, Flown


@cache
def flown(autopilot, *, size=0.9):
    """Asked for so much that rotors reach both of their limits."""
    return Flown(autopilot, AP if autopilot == "ardupilot" else None, seconds=6.0, size=size)


def rebuilt(autopilot, **rates):
    own = flown(autopilot)
    if autopilot == "px4":
        return rebuilt_rotors(own.px4_topics(**rates), CA, "PX4 1.15.0")
    return rebuilt_rotors(own.ardupilot_topics(**rates), COPTER, "ArduCopter 4.5.1")


@pytest.mark.parametrize(("autopilot", "rate_hz", "within"), [("px4", 50.0, 1e-6), ("ardupilot", 400.0, 2e-3)])
def test_thinned_motors_are_rebuilt_saturated_ones_too(autopilot, rate_hz, within):
    found, own = rebuilt(autopilot), flown(autopilot)
    assert found.refused == ""
    assert found.rate_hz == pytest.approx(rate_hz, rel=0.01)
    assert found.samples >= 55
    assert min(found.differences, *found.by_axis, found.common) > 0.999
    assert abs(found.lag) < 1e-3
    assert found.scale == pytest.approx(1.0, abs=3e-3)
    assert found.error < within
    least = 0.12 if autopilot == "ardupilot" else 0.0
    assert 0.1 < (own.command.min(axis=1) <= least + 1e-9).mean() < 0.9
    expected = np.column_stack([np.interp(found.time, own.time, column) for column in own.command.T])
    assert np.sqrt(((found.commands - expected) ** 2).mean()) < 3e-3


def test_logged_motors_that_lie_between_the_commands_are_interpolated():
    found, own = rebuilt("px4", torque_hz=100.0, motors_hz=41.0), flown("px4")
    assert found.refused == ""
    assert min(found.by_axis) > 0.97
    # What changes between two commands is their error, and it is stated.
    between = np.column_stack([np.interp(own.time, found.time, column) for column in found.commands.T]) - own.command
    assert found.error == pytest.approx(np.sqrt((between**2).mean()), rel=0.3)


def test_outputs_that_are_read_back_late_do_not_matter():
    found = rebuilt("ardupilot", late_s=0.05)
    assert found.refused == ""
    assert found.lag == pytest.approx(0.025, abs=0.01)
    assert min(found.by_axis) > 0.99


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"MOT_THST_EXPO": 0.0, "MOT_SPIN_MIN": 0.0, "MOT_SPIN_MAX": 1.0}, "they explain"),
        ({"FRAME_TYPE": 0.0}, "they explain"),
        ({"MOT_PWM_MAX": 2300.0}, "times as large|they explain|off the logged"),
    ],
)
def test_another_mixer_or_curve_is_refused(change, why):
    found = rebuilt_rotors(flown("ardupilot").ardupilot_topics(), COPTER | change, "ArduCopter 4.5.1")
    assert not found.faster
    assert re.search(why, found.refused)


def test_two_motors_of_one_diagonal_that_are_swapped_are_refused():
    topics = flown("px4").px4_topics()
    first, second = (topics["actuator_motors"][f"control[{motor}]"] for motor in (0, 1))
    topics["actuator_motors"] |= {"control[0]": second, "control[1]": first}
    found = rebuilt_rotors(topics, CA, "PX4 1.15.0")
    # About yaw they are right, which is most of what differs.
    assert found.by_axis[2] > 0.9
    assert "about" in found.refused


def test_late_stamps_and_few_samples_are_refused():
    topics = flown("px4").px4_topics()
    late = topics["actuator_motors"] | {"timestamp": topics["actuator_motors"]["timestamp"] + 0.03}
    assert not rebuilt_rotors(topics | {"actuator_motors": late}, CA, "PX4 1.15.0").faster
    short = {name: values[:25] for name, values in topics["actuator_motors"].items()}
    assert "only" in rebuilt_rotors(topics | {"actuator_motors": short}, CA, "PX4 1.15.0").refused


def test_nothing_is_rebuilt_without_its_sources():
    topics = flown("px4").px4_topics()
    motors = {"actuator_motors": topics["actuator_motors"]}
    assert rebuilt_rotors(motors, CA, "PX4 1.15.0") is None
    assert rebuilt_rotors(topics, {}, "ArduCopter 4.5") is None
    assert rebuilt_rotors({name: own for name, own in topics.items() if name not in motors}, CA, "PX4 1.15.0") is None
