"""What follows from the signals of a flight."""

import numpy as np
import pytest

from cpfls_cli.flights.flight import Flight

TIME = np.arange(3.0)
THREE = np.zeros((3, 3))


@pytest.mark.parametrize(
    ("signals", "lacks"),
    [
        ({}, ("attitude", "rotation", "torque")),
        ({"body_rate": THREE}, ("attitude", "torque")),
        ({"body_rate": THREE, "body_torque": THREE}, ("attitude",)),
        ({"attitude": THREE}, ("torque",)),
        ({"attitude": THREE, "body_torque": THREE}, ()),
        ({"attitude": THREE, "torque": THREE}, ()),
    ],
)
def test_what_later_commands_will_miss(signals, lacks):
    assert Flight(time=TIME, **signals).lacks == lacks


def test_a_flight_turns_where_roll_or_pitch_goes_round():
    def turns(axis, angle):
        attitude = THREE + np.where(np.arange(3) == axis, angle, 0.0) * TIME[:, None]
        return Flight(time=TIME, attitude=attitude, attitude_rate=THREE).turns

    assert [turns(axis, 3.2) for axis in range(3)] == [True, True, False]
    assert not turns(0, 3.1)
