"""What follows from the signals of a flight, of its import, and of the controllers that were compared on it."""

import numpy as np
import pytest

from cpfls_cli.artifacts.flight import FlightRecord, NoiseGroup, QualityGroup, TrackingGroup

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


def tracking(model, other):
    """Two controllers, with settled errors the same about all axes."""
    size = np.array([[model] * 3, [other] * 3])
    return TrackingGroup(
        controller=("model", "pd"),
        time=TIME,
        error=np.zeros((2, 3, 3)),
        settled_from=1.0,
        rms=size,
        settled_rms=size,
        max_error=size,
        settled_max=size,
        torque_rms=size,
        clipped=np.zeros(2),
        lost_at=np.where(np.isfinite(size[:, 0]), np.nan, 2.0),
        control_rate=100.0,
        outside=np.array([True, False, True]),
        not_positive_definite=0,
    )


def test_controllers_are_compared_where_neither_lost_the_vehicle():
    np.testing.assert_allclose(tracking(1.0, 4.0).ratio("pd"), [0.25] * 3)
    assert tracking(np.nan, 4.0).ratio("pd") is None
    assert tracking(1.0, np.nan).ratio("pd") is None
    assert tracking(1.0, 0.0).ratio("pd") is None
    assert [tracking(np.nan, 4.0).lost(name) for name in ("model", "pd")] == [True, False]
    assert tracking(1.0, 4.0).outside_count == 2
