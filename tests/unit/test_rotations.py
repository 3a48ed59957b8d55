import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli import rotations


def states(count=100):
    """Attitudes away from the pitch of +-90 degrees, where the Euler rates are not defined."""
    rng = np.random.default_rng(3)
    attitude = rng.uniform(-np.pi, np.pi, (count, 3))
    attitude[:, 1] = rng.uniform(-1.4, 1.4, count)
    return attitude, rng.standard_normal((count, 3)), rng.standard_normal((count, 3))


def test_rotation_matrix_is_scipys_intrinsic_zyx():
    attitude, _, _ = states()
    expected = Rotation.from_euler("ZYX", attitude[:, ::-1]).as_matrix()
    np.testing.assert_allclose(rotations.rotation_matrix(attitude), expected, atol=1e-14)


def test_angles_come_back_from_matrices():
    attitude, _, _ = states()
    np.testing.assert_allclose(rotations.euler_angles(rotations.rotation_matrix(attitude)), attitude, atol=1e-12)


def test_body_rate_is_the_rotation_vector_of_a_small_step():
    attitude, rate, _ = states()
    step = 1e-5
    before, after = (Rotation.from_euler("ZYX", (attitude + s * step * rate)[:, ::-1]) for s in (-1, 1))
    expected = (before.inv() * after).as_rotvec() / (2 * step)
    np.testing.assert_allclose(rotations.body_rate(attitude, rate), expected, atol=1e-8)


def test_attitude_rate_inverts_body_rate():
    attitude, rate, _ = states()
    back = rotations.attitude_rate(attitude, rotations.body_rate(attitude, rate))
    np.testing.assert_allclose(back, rate, rtol=1e-12, atol=1e-12)


def test_derivative_of_the_euler_rate_matrix():
    attitude, rate, _ = states()
    step = 1e-5
    ahead, behind = (rotations.euler_rate_matrix(attitude + s * step * rate) for s in (1, -1))
    derivative = rotations.euler_rate_matrix_derivative(attitude, rate)
    np.testing.assert_allclose(derivative, (ahead - behind) / (2 * step), atol=1e-8)


def test_body_acceleration_is_the_derivative_of_the_body_rate():
    attitude, rate, acceleration = states()
    step = 1e-5
    ahead, behind = (
        rotations.body_rate(attitude + s * rate + 0.5 * s**2 * acceleration, rate + s * acceleration)
        for s in (step, -step)
    )
    expected = (ahead - behind) / (2 * step)
    np.testing.assert_allclose(rotations.body_acceleration(attitude, rate, acceleration), expected, atol=1e-8)


def test_body_torque_inverts_generalised_torque():
    attitude, torque, _ = states()
    back = rotations.body_torque(attitude, rotations.generalised_torque(attitude, torque))
    np.testing.assert_allclose(back, torque, rtol=1e-12, atol=1e-12)


def test_both_torques_do_the_same_work():
    attitude, rate, body_torque = states()
    generalised = rotations.generalised_torque(attitude, body_torque)
    power = np.sum(rotations.body_rate(attitude, rate) * body_torque, axis=1)
    np.testing.assert_allclose(np.sum(rate * generalised, axis=1), power, atol=1e-13)


def test_vertical_pitch_raises_no_warning():
    """Warnings are errors here: a log that passes through the singularity must not stop a command."""
    attitude = np.array([[0.0, np.pi / 2, 0.0]])
    assert rotations.attitude_rate(attitude, np.ones((1, 3))).shape == (1, 3)
    assert rotations.body_torque(attitude, np.ones((1, 3))).shape == (1, 3)


@pytest.mark.parametrize("shapes", [((3,), (3,)), ((5, 1, 3), (1, 4, 3)), ((7, 3), (3,))])
def test_cross_product_is_numpys_to_the_bit(shapes):
    rng = np.random.default_rng(0)
    first, second = (rng.normal(size=shape) for shape in shapes)
    np.testing.assert_array_equal(rotations.cross(first, second), np.cross(first, second))
