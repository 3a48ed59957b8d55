import numpy as np

from cpfls_cli.dynamics import inertia_matrix
from tests.builders.christoffel import torque

MOMENTS = 0.6, 0.7, 1.2


def random_attitudes(count):
    return np.random.default_rng(7).uniform(-np.pi, np.pi, (count, 3))


def test_inertia_matrix_has_the_printed_components():
    attitude = random_attitudes(200)
    roll, pitch, _ = attitude.T
    xx, yy, zz = MOMENTS
    J = inertia_matrix(attitude, np.diag(MOMENTS))
    printed = {
        (0, 0): np.full_like(roll, xx),
        (0, 1): np.zeros_like(roll),
        (0, 2): -xx * np.sin(pitch),
        (1, 1): yy * np.cos(roll) ** 2 + zz * np.sin(roll) ** 2,
        (1, 2): (yy - zz) * np.cos(roll) * np.sin(roll) * np.cos(pitch),
        (2, 2): xx * np.sin(pitch) ** 2
        + yy * np.sin(roll) ** 2 * np.cos(pitch) ** 2
        + zz * np.cos(roll) ** 2 * np.cos(pitch) ** 2,
    }
    for (row, column), component in printed.items():
        np.testing.assert_allclose(J[:, row, column], component, atol=1e-15)
        np.testing.assert_allclose(J[:, column, row], component, atol=1e-15)


def test_pitch_term_of_yaw_rate_is_half_the_slope_of_d33():
    """Equation (16) prints D_223 where (4) gives D_233 = -1/2 dD33/dtheta."""
    attitude = random_attitudes(50)
    roll, pitch, _ = attitude.T
    xx, yy, zz = MOMENTS
    slope = 2 * np.sin(pitch) * np.cos(pitch) * (xx - yy * np.sin(roll) ** 2 - zz * np.cos(roll) ** 2)
    turning = np.broadcast_to([0.0, 0.0, 2.0], attitude.shape)
    pitch_torque = torque(attitude, turning, np.zeros_like(attitude), np.diag(MOMENTS))[:, 1]
    np.testing.assert_allclose(pitch_torque, -0.5 * slope * 4, atol=1e-14)


def test_a_level_body_accelerates_by_its_own_moments():
    zero = np.zeros((1, 3))
    np.testing.assert_allclose(torque(zero, zero, np.ones((1, 3)), np.diag(MOMENTS)), [MOMENTS])
