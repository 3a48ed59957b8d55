"""What was asked of an autopilot: converted as what it is a setpoint of, held, and no reason to drop a sample."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli.errors import SettingError
from cpfls_cli.flightlog.importing import import_log, read_signals
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap
from cpfls_cli.flightlog.topics import hold_asked, on_one_clock

PERIOD, SAMPLES = 0.01, 401
TIME = PERIOD * np.arange(SAMPLES)
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLIP = np.diag([1.0, -1.0, -1.0])


def mapped(unit, *columns, **more):
    return SignalMap(columns=columns, unit=unit, **more)


def named(prefix, values):
    return {f"{prefix}{axis}": column for axis, column in enumerate(np.asarray(values).T)}


def columns_of(prefix, number=3):
    return tuple(f"{prefix}{axis}" for axis in range(number))


RATE = {"body_rate": mapped("rad/s", *columns_of("p"))}


def log(**values):
    rate = np.column_stack([np.sin(3 * TIME), np.cos(2 * TIME), 0.3 * np.sin(TIME)])
    return (
        {"t": TIME} | named("p", rate) | {k: v for prefix, own in values.items() for k, v in named(prefix, own).items()}
    )


def settings(signals, **changes):
    return ImportSettings(signals=RATE | signals, torque_source=None, **changes)


def asked(signals, values, **changes):
    return read_signals(log(**values), settings(signals, **changes)).asked


def test_vectors_are_turned_as_those_that_are_measured():
    wished = np.column_stack([TIME, 2 * TIME, np.sin(TIME)])
    signals = {
        "setpoint_position": mapped("mm", *columns_of("x")),
        "setpoint_velocity": mapped("m/s", *columns_of("v")),
        "setpoint_body_rate": mapped("deg/s", *columns_of("w")),
    }
    values = {"x": 1000 * wished, "v": wished, "w": np.degrees(wished)}
    found = asked(signals, values, body_frame="FRD", world_frame="NED")
    np.testing.assert_allclose(found["setpoint_position"], wished @ NED.T, atol=1e-12)
    np.testing.assert_allclose(found["setpoint_velocity"], wished @ NED.T, atol=1e-12)
    np.testing.assert_allclose(found["setpoint_body_rate"], wished @ FLIP, atol=1e-12)


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
@pytest.mark.parametrize("as_quaternion", [True, False])
def test_an_attitude_is_the_same_rotation_in_the_axes_of_the_program(as_quaternion, order):
    angles = np.column_stack([0.3 * np.sin(TIME), 0.2 * np.cos(TIME), 4 * TIME])
    wished = Rotation.from_euler("ZYX", angles[:, ::-1])
    logged, unit = np.degrees((angles + np.pi) % (2 * np.pi) - np.pi), "deg"
    if as_quaternion:
        logged, unit = wished.as_quat(), "1"
        logged = np.roll(logged, 1, axis=1) if order == "wxyz" else logged
    signals = {"setpoint_attitude": mapped(unit, *columns_of("q", logged.shape[1]))}
    found = asked(signals, {"q": logged}, body_frame="FRD", world_frame="NED", quaternion_order=order)[
        "setpoint_attitude"
    ]
    turned = Rotation.from_euler("ZYX", found[:, ::-1]).as_matrix()
    np.testing.assert_allclose(turned, NED @ wished.as_matrix() @ FLIP, atol=1e-9)
    assert np.abs(np.diff(found, axis=0)).max() < 0.1, "a full turn is no jump"


def test_what_is_nowhere_asked_for_drops_no_sample():
    wished = np.column_stack([TIME, TIME, TIME])
    wished[50:300] = np.nan
    flight = read_signals(
        log(x=wished, q=np.full((SAMPLES, 1), np.nan)),
        settings(
            {"setpoint_position": mapped("m", *columns_of("x")), "setpoint_thrust": mapped("1", "q0", required=False)}
        ),
    )
    assert len(flight.time) == SAMPLES
    assert not any(flight.dropped.values())
    assert list(flight.setpoints) == ["position"]
    known = np.isfinite(flight.setpoint_position).all(axis=1)
    # Held for import.gap_s beyond the last one, and not one sample before the next.
    np.testing.assert_array_equal(np.flatnonzero(~known), np.arange(60, 300))
    assert any("setpoint_thrust is left out" in warning for warning in flight.warnings)


def test_setpoints_are_neither_filtered_nor_shifted_and_keep_the_previous_value_at_another_rate():
    steps = (np.arange(SAMPLES) // 20)[:, None].astype(float)
    own = settings({"sticks": mapped("1", "s0", "s1", "s2", scale=0.01)}, lowpass_hz=5.0, rate_hz=250.0)
    flight = import_log(log(s=np.hstack([steps, -steps, 0 * steps])), own)
    np.testing.assert_allclose(flight.sticks[:, 0], 0.01 * np.floor(flight.time / 0.2 + 1e-6), atol=1e-12)
    delayed = import_log(log(s=np.hstack([steps, -steps, 0 * steps])), replace(own, delay_s=0.05, rate_hz=None))
    np.testing.assert_allclose(delayed.sticks[:, 0], 0.01 * steps[5:, 0], atol=1e-12)


def test_a_setpoint_is_held_for_three_of_its_steps():
    time, values = np.array([1.0, 1.2, 1.4, 1.6, 3.0]), np.array([1.0, 2.0, np.nan, 4.0, 5.0])
    held = hold_asked(time, values, np.array([0.3, 0.5, 1.1, 1.3, 1.5, 1.7, 2.1, 2.5, 2.95, 3.3, 4.0]), 0.1)
    # The steps that are known are 0.2, 0.4 and 1.4 s.
    np.testing.assert_array_equal(held, [1.0, 1.0, 1.0, 2.0, 2.0, 4.0, 4.0, 4.0, np.nan, 5.0, 5.0])
    often = hold_asked(np.append(0.01 * np.arange(50), 9.0), np.arange(51.0), np.array([0.5, 0.6, 8.0, 9.05, 9.2]), 0.1)
    np.testing.assert_array_equal(often, [49.0, np.nan, np.nan, 50.0, np.nan])


def test_topics_of_setpoints_are_no_clock_no_gap_and_may_be_slow():
    topics = {
        "gyro": {"timestamp": TIME} | named("p", np.ones((SAMPLES, 3))),
        "fast": {"timestamp": TIME[:-1] + 0.5 * PERIOD} | named("w", np.ones((SAMPLES - 1, 3))),
        "slow": {"timestamp": TIME[::40]} | named("x", np.column_stack([np.arange(11.0)] * 3)),
    }
    topics["fast"]["timestamp"] = np.linspace(0, TIME[-1], SAMPLES - 1)
    signals = {
        "body_rate": mapped("rad/s", *(f"gyro.p{axis}" for axis in range(3))),
        "setpoint_body_rate": mapped("rad/s", *(f"fast.w{axis}" for axis in range(3))),
        "setpoint_position": mapped("m", *(f"slow.x{axis}" for axis in range(3))),
    }
    own = ImportSettings(time_column=None, torque_source=None, signals=signals)
    columns, chosen, warnings = on_one_clock(topics, {}, own)
    assert chosen.time_column == "gyro.timestamp"
    assert warnings == ()
    np.testing.assert_array_equal(columns["slow.x0"], np.arange(SAMPLES) // 40)


@pytest.mark.parametrize(
    ("key", "signals"),
    [
        ("signals.setpoint_attitude.columns", RATE | {"setpoint_attitude": mapped("1", "a", "b", "c")}),
        ("signals.setpoint_attitude.columns", RATE | {"setpoint_attitude": mapped("deg", "a", "b", "c", "d")}),
        ("signals.setpoint_thrust.unit", RATE | {"setpoint_thrust": mapped("m", "a")}),
        ("signals.sticks.columns", RATE | {"sticks": mapped("1", "a", "b")}),
        ("signals", {"sticks": mapped("1", "a", "b", "c", "d")}),
    ],
)
def test_a_map_of_setpoints_that_cannot_be_is_refused_at_its_key(key, signals):
    with pytest.raises(SettingError) as caught:
        ImportSettings(signals=signals, torque_source=None)
    assert caught.value.key == key


def test_a_flight_holds_its_setpoints_and_counts_where_they_are_known():
    thrust = np.linspace(0.2, 0.6, SAMPLES)[:, None].copy()
    thrust[:21] = np.nan
    signals = {"setpoint_position": mapped("m", *columns_of("x")), "setpoint_thrust": mapped("1", "f0")}
    record = import_log(log(x=np.column_stack([TIME, TIME, TIME]), f=thrust), settings(signals))
    assert record.setpoint_thrust is not None
    assert record.setpoint_thrust.shape == (SAMPLES,)
    # The first value goes back by import.gap_s, and no further.
    assert record.setpoints == {"position": SAMPLES, "thrust": SAMPLES - 11}


def test_on_a_clock_that_was_computed_a_setpoint_is_not_a_row_late():
    time = 1e-6 * np.round(1e6 * (17.3 + np.arange(4000) / 300))
    values = np.arange(len(time), dtype=float)
    clock = time[0] + float(np.median(np.diff(time))) * np.arange(1000)
    np.testing.assert_array_equal(hold_asked(time, values, clock, 0.1)[:50], values[:50])


def test_an_attitude_that_is_asked_for_is_within_half_a_turn_of_the_one_that_is_flown():
    angles = np.column_stack([0.1 * np.sin(TIME), 0.1 * np.cos(TIME), 3 * TIME])
    wished = angles + np.array([0.0, 0.0, 0.4 - 2 * np.pi])
    signals = {"attitude": mapped("rad", *columns_of("a")), "setpoint_attitude": mapped("rad", *columns_of("q"))}
    flight = read_signals(log(a=angles, q=(wished + np.pi) % (2 * np.pi) - np.pi), settings(signals))
    away = flight.setpoint_attitude - flight.attitude
    np.testing.assert_allclose(away, np.tile([0.0, 0.0, 0.4], (SAMPLES, 1)), atol=1e-9)
