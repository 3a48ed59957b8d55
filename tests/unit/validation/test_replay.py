"""Windows, predictors and lost runs."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.identification.data import TorqueData, joined
from cpfls_cli.inertia import symmetric
from cpfls_cli.rotations import generalised_torque
from cpfls_cli.validation.replay import NOTHING_MOVES, replay_steps
from tests.builders.flights import rigid_torque, rotating_motion, still_flight

INERTIA = np.array([0.6, 0.8, 1.2, 0.0, 0.0, 0.0])


def rotating_flight():
    time, motion = rotating_motion(71, samples=300, duration=6.0)
    return TorqueData(time, motion, rigid_torque(symmetric(INERTIA))(motion))


def level(samples):
    return still_flight(np.zeros((samples, 3)))


def test_nothing_moves_is_off_by_what_moved():
    """A steady roll: after k steps the attitude is off by its rate times the time, the rate by nothing."""
    data = level(60)
    motion = replace(data.motion, attitude=data.time[:, None] * [0.7, 0, 0], rate=np.tile([0.7, 0.0, 0.0], (60, 1)))
    found = replay_steps("x", replace(data, motion=motion), {"body": INERTIA}, 10, 20)
    assert found.model == ("body", NOTHING_MOVES)
    np.testing.assert_allclose(found.attitude[1], found.horizon[:, None] * [0.7, 0, 0], atol=1e-12)
    np.testing.assert_allclose(found.body_rate[1], 0.0, atol=1e-12)
    # A steady roll is what a body without torque does.
    np.testing.assert_allclose(found.attitude[0], 0.0, atol=1e-10)


def test_no_window_crosses_a_pause():
    one, other = level(30), level(45)
    found = replay_steps("x", joined([one, other]), {"body": INERTIA}, 20, 1000)
    assert found.windows == (30 - 20) + (45 - 20)
    np.testing.assert_allclose(found.horizon, 0.01 * np.arange(1, 21))


def test_windows_are_evenly_spread_and_shorter_where_none_fits():
    found = replay_steps("x", level(30), {"body": INERTIA}, 100, 1000)
    assert len(found.samples) == 25
    assert found.windows == 5
    assert replay_steps("x", level(101), {"body": INERTIA}, 20, 10).windows == 10


def test_no_window_at_a_vertical_pitch():
    data = level(50)
    attitude = np.zeros((50, 3))
    attitude[20:] = [0.0, np.pi / 2, 0.0]
    steep = replace(data, motion=replace(data.motion, attitude=attitude))
    assert replay_steps("x", steep, {"body": INERTIA}, 4, 1000).windows == 16
    found = replay_steps("x", steep[20:], {"body": INERTIA}, 4, 1000)
    assert found.windows == 0
    assert np.isnan(found.attitude).all()
    assert found.window_error.shape == (2, 0, 3)
    assert len(found.start) == 0


@pytest.mark.parametrize("inertia", [[0.6, -0.8, 1.2, 0, 0, 0], [0.6, 0.8, 0.0, 0, 0, 0], [0.6, 0.8, 1.2, 0.9, 0, 0]])
def test_a_body_that_is_none_is_told_and_does_not_spoil_the_others(inertia):
    data = rotating_flight()
    found = replay_steps("x", data, {"none": np.array(inertia), "body": INERTIA}, 10, 20)
    np.testing.assert_array_equal(found.lost, np.repeat([[20], [0], [0]], 10, axis=1))
    assert np.isnan(found.attitude[0]).all()
    assert np.isnan(found.body_rate[0]).all()
    assert np.isnan(found.window_error[0]).all()
    alone = replay_steps("x", data, {"body": INERTIA}, 10, 20)
    np.testing.assert_array_equal(found.attitude[1:], alone.attitude)


def test_a_body_far_too_light_is_lost_and_nothing_overflows():
    found = replay_steps("x", rotating_flight(), {"light": 1e-9 * INERTIA}, 50, 20)
    assert found.lost[0, -1] == 20
    assert np.all(np.diff(found.lost[0]) >= 0)


def test_windows_are_the_same_read_at_once_or_one_by_one(monkeypatch):
    data = rotating_flight()
    at_once = replay_steps("x", data, {"body": 1.1 * INERTIA}, 12, 30)
    monkeypatch.setattr("cpfls_cli.validation.replay._SAMPLES_AT_ONCE", 13)
    by_one = replay_steps("x", data, {"body": 1.1 * INERTIA}, 12, 30)
    # Slower windows among themselves take fewer steps of integration.
    np.testing.assert_allclose(by_one.attitude, at_once.attitude, rtol=1e-3)
    np.testing.assert_allclose(by_one.window_error, at_once.window_error, rtol=1e-3)


def test_errors_by_window_and_by_horizon_are_the_same_errors():
    found = replay_steps("x", rotating_flight(), {"body": 1.1 * INERTIA}, 12, 30)
    by_window, by_horizon = np.mean(found.window_error, axis=1), np.mean(found.body_rate**2, axis=1)
    np.testing.assert_allclose(by_window, by_horizon)


def test_a_constant_torque_is_taken_off_what_was_measured():
    data, constant = rotating_flight(), np.array([0.3, -0.2, 0.1])
    pushed = replace(data, torque=data.torque + generalised_torque(data.motion.attitude, np.tile(constant, (300, 1))))
    plain = replay_steps("x", data, {"body": INERTIA, "other": 1.1 * INERTIA}, 12, 30)
    found = replay_steps("x", pushed, {"body": INERTIA, "other": 1.1 * INERTIA}, 12, 30, {"body": constant})
    np.testing.assert_allclose(found.body_rate[0], plain.body_rate[0], rtol=1e-6, atol=1e-9)
    assert np.mean(found.window_error[1]) > 1.5 * np.mean(plain.window_error[1])
