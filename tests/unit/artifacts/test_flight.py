"""What follows from the signals of a flight, of its import, and of the controllers that were compared on it."""

import numpy as np
import pytest

from cpfls_cli.artifacts.flight import FlightRecord, NoiseGroup, QualityGroup

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
    assert FlightRecord(time=TIME, **signals).lacks == lacks


def test_a_flight_turns_where_roll_or_pitch_goes_round():
    def turns(axis, angle):
        attitude = THREE + np.where(np.arange(3) == axis, angle, 0.0) * TIME[:, None]
        return FlightRecord(time=TIME, attitude=attitude, attitude_rate=THREE).turns

    assert [turns(axis, 3.2) for axis in range(3)] == [True, True, False]
    assert not turns(0, 3.1)


def test_warnings_are_added_to_those_of_the_log():
    quality = QualityGroup.of({"gaps: interpolated": 2}, ["a fault"], {"body_rate": 18.0}, {"rotor_command": 9.9})
    flight = FlightRecord(time=TIME, quality=quality).with_warnings(["no attitude"])
    assert flight.quality.warning == ("a fault", "no attitude")
    assert flight.quality.findings == {"gaps: interpolated": 2}
    assert flight.quality.updated_hz == {"rotor_command": 9.9}
    assert QualityGroup.of({}, [], {}, {}) is None
    assert FlightRecord(time=TIME).with_warnings(["no attitude"]).quality.findings == {}


def test_noise_is_kept_of_signals_with_three_axes():
    noise = NoiseGroup.of({"torque": np.full(3, 0.1), "rotor_speed": np.full(4, 1.0)})
    assert noise.signal == ("torque",)
    assert NoiseGroup.of({"rotor_speed": np.full(4, 1.0)}) is None
