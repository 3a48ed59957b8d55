import numpy as np
import pytest

from cpfls_cli.errors import ComputationError
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.trajectory.planning import flat_attitude

GRAVITY = 9.81
FREQUENCIES = np.array([1.3, 0.9, 1.7])
PHASES = np.array([0.2, 1.1, 2.3])
AMPLITUDES = np.array([6.0, 5.0, 4.0])


def oscillation(time):
    """Acceleration, jerk and snap of a sinusoidal motion, and a yaw that oscillates on top of a turn."""
    angle = np.outer(time, FREQUENCIES) + PHASES
    sine, cosine = AMPLITUDES * np.sin(angle), AMPLITUDES * np.cos(angle)
    translation = np.stack([sine, FREQUENCIES * cosine, -(FREQUENCIES**2) * sine])
    heading = [0.8 * time + 0.5 * np.sin(2 * time), 0.8 + np.cos(2 * time), -2 * np.sin(2 * time)]
    return translation, np.stack(heading)


def flown(time):
    return flat_attitude(time, *oscillation(time), GRAVITY)


def test_thrust_along_body_z_gives_the_acceleration():
    time = np.linspace(0, 20, 500)
    force = oscillation(time)[0][0] + [0, 0, GRAVITY]
    thrust = np.linalg.norm(force, axis=1)[:, None] * rotation_matrix(flown(time).attitude)[:, :, 2]
    np.testing.assert_allclose(thrust, force, atol=1e-12)


def test_angles_are_those_of_equation_18():
    time = np.linspace(0, 20, 500)
    translation, heading = oscillation(time)
    x, y, z = translation[0].T
    sine, cosine = np.sin(heading[0]), np.cos(heading[0])
    roll = np.arcsin((x * sine - y * cosine) / np.sqrt(x**2 + y**2 + (z + GRAVITY) ** 2))
    pitch = np.arctan((x * cosine + y * sine) / (z + GRAVITY))
    np.testing.assert_allclose(flown(time).attitude, np.column_stack([roll, pitch, heading[0]]), atol=1e-12)


@pytest.mark.parametrize(
    ("of", "derivative"), [("attitude", "attitude_rate"), ("attitude_rate", "attitude_acceleration")]
)
def test_derivatives_agree_with_finite_differences(of, derivative):
    step = 1e-3
    time = np.arange(0, 20, step)
    values = getattr(flown(time), of)
    difference = (values[:-4] - 8 * values[1:-3] + 8 * values[3:-1] - values[4:]) / (12 * step)
    analytic = getattr(flown(time), derivative)[2:-2]
    np.testing.assert_allclose(analytic, difference, atol=1e-6 * np.abs(difference).max())


def test_free_fall_is_refused_with_its_time():
    translation = np.zeros((3, 3, 3))
    translation[0, 1, 2] = -GRAVITY
    with pytest.raises(ComputationError, match=r"free fall at t = 0.5 s"):
        flat_attitude(np.array([0.0, 0.5, 1.0]), translation, np.zeros((3, 3)), GRAVITY)


def test_free_fall_between_two_samples_is_refused():
    translation = np.zeros((3, 3, 3))
    translation[0, 2, 2] = -2 * GRAVITY
    with pytest.raises(ComputationError, match=r"free fall at t = 1 s"):
        flat_attitude(np.array([0.0, 0.5, 1.0]), translation, np.zeros((3, 3)), GRAVITY)


def test_sideways_thrust_is_refused():
    translation = np.zeros((3, 1, 3))
    translation[0, 0] = [0.0, 5.0, -GRAVITY]
    with pytest.raises(ComputationError, match=r"roll of 90 degrees at t = 0 s"):
        flat_attitude(np.zeros(1), translation, np.zeros((3, 1)), GRAVITY)
