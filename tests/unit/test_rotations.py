"""Rotations, and inertia as a tensor."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli import rotations
from cpfls_cli.inertia import (
    INERTIA_ENTRIES,
    INERTIA_PARAMETERS,
    beyond_any_body,
    body_torque_columns,
    more_than_others,
    symmetric,
    symmetric_columns,
)

PARAMETERS = np.array([1.0, 2.0, 3.0, 0.4, 0.5, 0.6])
MATRIX = np.array([[1.0, 0.4, 0.5], [0.4, 2.0, 0.6], [0.5, 0.6, 3.0]])


def states(count=100):
    """Attitudes away from the pitch of +-90 degrees, where the Euler rates are not defined."""
    rng = np.random.default_rng(3)
    attitude = rng.uniform(-np.pi, np.pi, (count, 3))
    attitude[:, 1] = rng.uniform(-1.4, 1.4, count)
    return attitude, rng.standard_normal((count, 3)), rng.standard_normal((count, 3))


def test_angles_and_matrices_are_those_of_scipy_and_come_back():
    attitude, _, _ = states()
    expected = Rotation.from_euler("ZYX", attitude[:, ::-1]).as_matrix()
    np.testing.assert_allclose(rotations.rotation_matrix(attitude), expected, atol=1e-14)
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


def test_torques_of_body_and_coordinates_are_inverse_and_do_the_same_work():
    attitude, torque, _ = states()
    back = rotations.body_torque(attitude, rotations.generalised_torque(attitude, torque))
    np.testing.assert_allclose(back, torque, rtol=1e-12, atol=1e-12)
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


def vectors(seed, count=50):
    return np.random.default_rng(seed).normal(size=(count, 3))


def test_parameters_fill_the_matrix_and_columns_times_them_are_its_product():
    np.testing.assert_array_equal(symmetric(PARAMETERS), MATRIX)
    np.testing.assert_array_equal(symmetric((1.0, 2.0, 3.0)), np.diag([1.0, 2.0, 3.0]))
    axes = "xyz"
    assert tuple(f"I{axes[row]}{axes[column]}" for row, column in INERTIA_ENTRIES) == INERTIA_PARAMETERS
    v = vectors(1)
    np.testing.assert_allclose(symmetric_columns(v) @ PARAMETERS, v @ MATRIX, atol=1e-14)


def test_body_torque_by_euler_s_equations():
    (p, q, r), (dp, dq, dr) = vectors(2).T, vectors(3).T
    xx, yy, zz = PARAMETERS[:3]
    expected = np.column_stack([xx * dp + (zz - yy) * q * r, yy * dq + (xx - zz) * p * r, zz * dr + (yy - xx) * p * q])
    torque = body_torque_columns(vectors(2), vectors(3))[:, :, :3] @ PARAMETERS[:3]
    np.testing.assert_allclose(torque, expected, atol=1e-13)


@pytest.mark.parametrize("axis", range(3))
def test_torque_of_a_full_tensor_is_the_change_of_its_angular_momentum(axis):
    """Along a turn about one body axis, where world and body axes agree at time 0: d(R I omega)/dt."""
    rate, acceleration, step = 1.3, -0.7, 1e-5
    direction = np.eye(3)[axis]

    def momentum(time):
        angle, speed = rate * time + acceleration * time**2 / 2, rate + acceleration * time
        return Rotation.from_rotvec(angle * direction).apply(MATRIX @ (speed * direction))

    expected = (momentum(step) - momentum(-step)) / (2 * step)
    found = body_torque_columns(rate * direction[None], acceleration * direction[None])[0] @ PARAMETERS
    np.testing.assert_allclose(found, expected, atol=1e-8)


def test_a_body_with_all_its_mass_in_the_hubs_can_be_and_one_twice_as_heavy_cannot():
    hubs = np.array([[0.3, 0.0, 0.02], [0.0, -0.2, 0.02], [-0.3, 0.0, 0.02], [0.0, 0.2, 0.02]])
    in_hubs = {"inertia.Ixx": 6 * 0.0404, "inertia.Iyy": 6 * 0.0904, "inertia.Izz": 6 * 0.09, "thrust_factor": 1e9}
    assert beyond_any_body(6.0, hubs, in_hubs) == {}
    twice = beyond_any_body(6.0, hubs, {name: 2 * value for name, value in in_hubs.items()})
    assert list(twice) == ["inertia.Ixx", "inertia.Iyy", "inertia.Izz"]
    assert twice["inertia.Iyy"] == pytest.approx(1.25**2 * 6 * 0.0904)


@pytest.mark.parametrize(
    ("moments", "named"), [((1.0, 2.0, 3.0), ()), ((3.4, 2.0, 1.0), ("Ixx",)), ((0.01, 0.1, 0.05), ("Iyy",))]
)
def test_a_moment_is_no_more_than_the_others_together_but_for_what_is_measured(moments, named):
    assert more_than_others(moments) == named
