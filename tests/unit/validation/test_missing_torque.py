"""The constant torque that a prediction misses, found and put back."""

import numpy as np

from cpfls_cli.identification.data import Flights, TorqueData
from cpfls_cli.regressor import Motion
from cpfls_cli.rotations import generalised_torque
from cpfls_cli.validation.missing_torque import mean_missing_torque, with_constant

CONSTANT = np.array([0.4, -0.3, 0.2])


def flight(seed=92, samples=200):
    rng = np.random.default_rng(seed)
    attitude = rng.uniform(-np.pi, np.pi, (samples, 3))
    attitude[::9, 1] = np.pi / 2
    motion = Motion(attitude, rng.standard_normal((samples, 3)), np.zeros((samples, 3)))
    return TorqueData(
        np.arange(samples), motion, 2 * motion.rate + generalised_torque(attitude, np.tile(CONSTANT, (samples, 1)))
    )


def predicted(motion):
    return 2 * motion.rate


def test_a_constant_is_found_in_body_axes_whatever_the_attitude():
    both = Flights((flight(), flight(93)))
    np.testing.assert_allclose(mean_missing_torque(both, predicted), CONSTANT, rtol=1e-9)


def test_put_back_nothing_is_missing():
    data = flight()
    np.testing.assert_allclose(with_constant(predicted, CONSTANT)(data.motion), data.torque, atol=1e-12)


def test_a_vertical_pitch_throughout_tells_nothing():
    np.testing.assert_array_equal(mean_missing_torque(flight()[::9], predicted), np.zeros(3))
