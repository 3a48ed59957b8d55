"""Momentum form against differentiated equations of motion, for bodies and for any J(q)."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli import rotations
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.gap.balance.inertial import rotation_balance, translation_balance
from cpfls_cli.gap.balance.windows import windows
from cpfls_cli.regressor.regressor import InertiaValues
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.gap_flights import sines

TENSOR = np.array([[0.6, 0.03, -0.02], [0.03, 0.7, 0.04], [-0.02, 0.04, 1.2]])
VEHICLE = VehicleSettings(inertia_kg_m2=(0.6, 0.7, 1.2, 0.03, -0.02, 0.04))
TIME = 0.005 * np.arange(1600)
ATTITUDE, RATE, SECOND = sines(TIME, [0.4, 0.3, 0.8], 0.2, 1.0, np.random.default_rng(0))
VELOCITY, ACCELERATION, _ = sines(TIME, [3.0, 2.0, 1.0], 0.1, 0.6, np.random.default_rng(1))
FLIGHT = Signals(
    time=TIME,
    vehicle=VEHICLE,
    attitude=ATTITUDE,
    body_rate=rotations.body_rate(ATTITUDE, RATE),
    velocity=VELOCITY,
    stated_thrust=np.full(len(TIME), 58.86),
)
THROUGH = windows(0.005, 0.4, 0.5)


def averaged(balance):
    return THROUGH.average(balance.direct) + THROUGH.derivative(balance.momentum)


def test_rigid_body_is_newton_and_euler():
    turning = rotations.body_acceleration(ATTITUDE, RATE, SECOND)
    expected = turning @ TENSOR + np.cross(FLIGHT.body_rate, FLIGHT.body_rate @ TENSOR)
    np.testing.assert_allclose(averaged(rotation_balance(FLIGHT)), THROUGH.average(expected), atol=2e-6)
    assert np.abs(expected).max() > 1


class Patterned:
    """A positive definite J(q) that belongs to no body: constants plus waves along each angle."""

    def __init__(self):
        rng = np.random.default_rng(2)
        self.waves = [0.05 * (wave + wave.T) for wave in rng.standard_normal((3, 3, 3))]

    def inertia(self, attitude):
        value = np.tile(TENSOR, (len(attitude), 1, 1))
        gradient = np.zeros((len(attitude), 3, 3, 3))
        for angle, wave in enumerate(self.waves):
            value += np.sin(2 * attitude[:, angle])[:, None, None] * wave
            gradient[:, angle] = 2 * np.cos(2 * attitude[:, angle])[:, None, None] * wave
        return InertiaValues(value, gradient)


def lagrange_torque(model):
    """J qdd + C qd with the symbols of Christoffel, entry by entry."""
    found = model.inertia(ATTITUDE)
    D = found.gradient
    torque = np.einsum("nij,nj->ni", found.value, SECOND)
    for i in range(3):
        for j in range(3):
            for k in range(3):
                symbol = 0.5 * (D[:, k, i, j] + D[:, j, i, k] - D[:, i, j, k])
                torque[:, i] += symbol * RATE[:, j] * RATE[:, k]
    return torque


def test_a_model_in_euler_coordinates_is_lagrange_turned_to_the_body():
    model = Patterned()
    expected = rotations.body_torque(ATTITUDE, lagrange_torque(model))
    np.testing.assert_allclose(averaged(rotation_balance(FLIGHT, model)), THROUGH.average(expected), atol=2e-5)
    assert np.abs(expected - rotations.body_torque(ATTITUDE, SECOND @ TENSOR)).max() > 0.1


def test_a_model_needs_the_attitude_and_a_body_does_not():
    blind = replace(FLIGHT, attitude=None)
    np.testing.assert_array_equal(rotation_balance(blind).momentum, rotation_balance(FLIGHT).momentum)
    with pytest.raises(InputError, match="needs the attitude"):
        rotation_balance(blind, Patterned())


@pytest.mark.parametrize(
    "known",
    [{}, {"acceleration": ACCELERATION}, {"acceleration": 99 * ACCELERATION, "specific_force": "felt"}],
    ids=["velocity", "acceleration", "accelerometer first"],
)
def test_force_is_what_an_accelerometer_feels_times_the_mass(known):
    felt = Rotation.from_euler("ZYX", ATTITUDE[:, ::-1]).inv().apply(ACCELERATION + np.array([0.0, 0.0, 9.81]))
    given = {name: felt if isinstance(value, str) else value for name, value in known.items()}
    found = averaged(translation_balance(replace(FLIGHT, **given)))
    np.testing.assert_allclose(found, 6.0 * THROUGH.average(felt), atol=2e-5)
