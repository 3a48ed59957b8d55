"""The inverse dynamics at a pitch of +-90 degrees, where Euler angles are singular."""

import numpy as np

from cpfls_cli.dynamics import newton_euler_torque
from cpfls_cli.excitation import regressor_of
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.trajectory.rotation import RotationPath
from tests.builders.christoffel import torque

INERTIA = np.array([[0.6, 0.02, -0.01], [0.02, 0.7, 0.03], [-0.01, 0.03, 1.2]])


def through_vertical():
    """Motion of a path whose pitch at the first, third and last sample is 90, -90 and again 90 degrees."""
    rng = np.random.default_rng(5)
    sine, cosine = rng.standard_normal((3, 3)) * 0.4, rng.standard_normal((3, 3)) * 0.4
    sine[1], cosine[1] = 0.0, 0.0
    sine[1, 1] = 0.2
    path = RotationPath(np.array([0.4, np.pi / 2, 1.0]), np.array([1, 1, -1]), sine, cosine, 10.0)
    motion = path.sample(np.array([0.0, 2.4, 5.0, 7.6, 10.0]))
    return motion.attitude, motion.attitude_rate, motion.attitude_acceleration


def test_the_torque_is_finite_and_that_of_newton_and_euler():
    motion = through_vertical()
    found = torque(*motion, INERTIA)
    assert np.all(np.isfinite(found))
    np.testing.assert_allclose(found, newton_euler_torque(*motion, INERTIA), atol=1e-12)


def test_harmonic_columns_reach_the_torque_there_too():
    attitude, *_ = motion = through_vertical()
    structure = model_structure(StructureSettings())
    diagonal = np.diag([0.6, 0.7, 1.2])
    rng = np.random.default_rng(0)
    seen = rng.uniform(-3, 3, (3, 400, 3))
    coefficients = np.linalg.lstsq(
        regressor_of(structure, seen).reshape(-1, structure.parameters), torque(*seen, diagonal).ravel()
    )[0]
    predicted = regressor_of(structure, np.stack(motion)) @ coefficients
    np.testing.assert_allclose(predicted, torque(*motion, diagonal), atol=1e-10)
    assert attitude.shape == predicted.shape
