"""Simulation from the points of a flight: exact for the model that made it, wrong by as much as the torque is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli import rotations
from cpfls_cli.dynamics.integration import ReplayModel
from cpfls_cli.dynamics.rigid_body import inertia_matrix, inertia_matrix_gradient, inertia_tensor
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.gap.replay import held, replay, rigid_body, start_rate, start_samples, worst_stretch
from cpfls_cli.regressor.regressor import InertiaValues
from cpfls_cli.vehicle.settings import VehicleSettings

VEHICLE = VehicleSettings(inertia_kg_m2=(0.6, 0.7, 1.2, 0.03, -0.02, 0.04))
TENSOR = inertia_tensor(VEHICLE)
TIME = 0.005 * np.arange(2000)
HORIZON = 50


def attitude_motion():
    """Euler angles with their first and second derivatives, by formula."""
    frequency, phase = np.array([2.1, 1.7, 0.6]), np.array([0.0, 1.0, 2.0])
    angle = TIME[:, None] * frequency + phase
    size = np.array([0.5, 0.4, 1.5])
    return size * np.sin(angle), size * frequency * np.cos(angle), -size * frequency**2 * np.sin(angle)


ATTITUDE, RATE, ACCELERATION = attitude_motion()
BODY_RATE = rotations.body_rate(ATTITUDE, RATE)


def rigid_torque():
    alpha = rotations.body_acceleration(ATTITUDE, RATE, ACCELERATION)
    return alpha @ TENSOR + np.cross(BODY_RATE, BODY_RATE @ TENSOR)


def swinging_flight(torque, **given):
    full = {"attitude": ATTITUDE, "body_rate": BODY_RATE} | given
    return Signals(time=TIME, vehicle=VEHICLE, stated_torque=torque, **full)


class RigidInEulerCoordinates:
    def inertia(self, attitude):
        return InertiaValues(inertia_matrix(attitude, TENSOR), inertia_matrix_gradient(attitude, TENSOR))


class Bent:
    """A rigid body with 0.3 cos(roll) on top of D22, which no rigid body has."""

    def inertia(self, attitude):
        rigid = RigidInEulerCoordinates().inertia(attitude)
        value, gradient = rigid.value.copy(), rigid.gradient.copy()
        value[:, 1, 1] += 0.3 * np.cos(attitude[:, 0])
        gradient[:, 0, 1, 1] -= 0.3 * np.sin(attitude[:, 0])
        return InertiaValues(value, gradient)


def bent_torque():
    """The torque of `Bent` from its Lagrangian by hand, as a body torque."""
    roll = ATTITUDE[:, 0]
    extra = np.zeros_like(RATE)
    extra[:, 0] = 0.15 * np.sin(roll) * RATE[:, 1] ** 2
    extra[:, 1] = 0.3 * np.cos(roll) * ACCELERATION[:, 1] - 0.3 * np.sin(roll) * RATE[:, 0] * RATE[:, 1]
    return rigid_torque() + rotations.body_torque(ATTITUDE, extra)


@pytest.mark.parametrize(
    ("torque", "inertia"),
    [(rigid_torque(), TENSOR), (rigid_torque(), RigidInEulerCoordinates()), (bent_torque(), Bent())],
    ids=["tensor", "rigid in Euler coordinates", "bent"],
)
def test_the_model_that_made_the_flight_simulates_it(torque, inertia):
    signals = swinging_flight(torque)
    found = replay(signals, start_samples(signals, 20, HORIZON), HORIZON, ReplayModel(torque, inertia))
    assert found.rate.shape == found.attitude.shape == (HORIZON, 3)
    assert found.rate.max() < 2e-5
    assert found.attitude.max() < 1e-5


def test_a_wrong_model_is_worse_than_the_right_one():
    torque = bent_torque()
    signals = swinging_flight(torque)
    starts = start_samples(signals, 20, HORIZON)
    assert replay(signals, starts, HORIZON, rigid_body(signals)).rate[-1, 1] > 0.05


def test_a_missing_constant_torque_grows_with_the_horizon_as_it_must():
    missing = np.array([0.0, 0.0, 0.03])
    signals = swinging_flight(rigid_torque() - missing, attitude=None)
    starts = start_samples(signals, 10, HORIZON)
    found = replay(signals, starts, HORIZON, rigid_body(signals))
    expected = np.linalg.norm(np.linalg.solve(TENSOR, missing)) * found.horizon_s
    assert found.attitude is None
    # The gyroscopic term turns a part of the error to other axes.
    np.testing.assert_allclose(np.linalg.norm(found.rate, axis=1), expected, rtol=0.1)
    assert found.horizon_s[-1] == pytest.approx(HORIZON * 0.005)


def test_the_held_rate_is_wrong_by_what_the_rate_changed():
    signals = swinging_flight(rigid_torque())
    starts = start_samples(signals, 10, HORIZON)
    found = held(signals, starts, HORIZON)
    change = BODY_RATE[starts + HORIZON] - BODY_RATE[starts]
    np.testing.assert_allclose(found.rate[-1], np.sqrt(np.mean(change**2, axis=0)), rtol=1e-3)
    assert found.attitude[-1].max() > 100 * replay(signals, starts, HORIZON, rigid_body(signals)).attitude[-1].max()
    assert held(swinging_flight(rigid_torque(), attitude=None), starts, HORIZON).attitude is None


def test_a_smoothed_start_has_less_of_the_noise_and_does_not_lag():
    noise = 0.02 * np.random.default_rng(0).standard_normal(BODY_RATE.shape)
    noisy = start_rate(swinging_flight(rigid_torque(), body_rate=BODY_RATE + noise)) - BODY_RATE
    assert noisy[10:-10].std() < 0.65 * 0.02
    assert np.abs(start_rate(swinging_flight(rigid_torque())) - BODY_RATE).max() < 2e-5


def test_what_cannot_be_simulated_says_why():
    signals = swinging_flight(rigid_torque(), attitude=None)
    starts = start_samples(signals, 100, HORIZON)
    with pytest.raises(ComputationError, match="needs the attitude"):
        replay(signals, starts, HORIZON, ReplayModel(rigid_torque(), Bent()))
    with pytest.raises(ComputationError, match="no inverse"):
        replay(signals, starts, HORIZON, ReplayModel(rigid_torque(), np.zeros((3, 3))))
    with pytest.raises(InputError, match="too short"):
        start_samples(signals, 1, len(TIME))
    with pytest.raises(InputError, match="without rotor speeds"):
        rigid_body(swinging_flight(None))


def test_the_worst_stretch_is_where_the_torque_is_wrong():
    torque = rigid_torque()
    wrong = torque.copy()
    burst = (TIME > 6.2) & (TIME < 7.6)
    wrong[burst, 1] += 0.2
    signals = swinging_flight(torque)
    found = worst_stretch(signals, ReplayModel(wrong, TENSOR), ReplayModel(torque, TENSOR))
    assert (found.time[0], found.time[-1]) == pytest.approx((6.0, 7.995))
    assert found.restarts == pytest.approx([6.0, 7.0])
    assert found.axis == 1
    np.testing.assert_allclose(found.after, found.measured, atol=1e-4)
    assert np.abs(found.before - found.measured)[:, 1].max() > 0.1


def test_a_fault_of_the_gyro_shows_in_the_runs_that_start_from_the_log():
    torque, bias = rigid_torque(), np.array([0.0, 0.0, 0.05])
    signals = swinging_flight(torque)
    logged = replace(signals, body_rate=signals.body_rate + bias)
    model = ReplayModel(torque, TENSOR)
    found = worst_stretch(signals, model, model, logged)
    np.testing.assert_allclose(found.after, found.measured, atol=1e-4)
    starts = np.searchsorted(found.time, found.restarts)
    np.testing.assert_allclose((found.before - found.measured)[starts], np.tile(bias, (len(starts), 1)), atol=1e-4)
    assert found.axis == 2
