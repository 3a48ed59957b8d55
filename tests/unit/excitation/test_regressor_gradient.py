import numpy as np
import pytest

from cpfls_cli.excitation.conditioning import regressor_of
from cpfls_cli.excitation.motion_gradient import motion_gradient
from cpfls_cli.excitation.regressor_gradient import regressor_gradient
from cpfls_cli.regressor import StructureSettings, model_structure

SEESAW = StructureSettings(consequents="seesaw", products="additive", membership_functions=5)


@pytest.mark.parametrize("settings", [StructureSettings(), SEESAW], ids=["harmonic", "seesaw"])
def test_slopes_by_rate_and_acceleration_are_those_of_differences(settings):
    structure = model_structure(settings)
    rng = np.random.default_rng(0)
    motion, weights = rng.uniform(-3, 3, (3, 40, 3)), rng.standard_normal((40, 3, structure.parameters))
    found = regressor_gradient(structure, motion, weights)
    # Q is quadratic in the rates and linear in the accelerations, so that a step of one is exact.
    expected = motion_gradient(lambda moved: regressor_of(structure, moved), motion, weights, 1.0)
    np.testing.assert_allclose(found[1:], expected[1:], rtol=1e-9, atol=1e-9)
    assert np.abs(expected[1:]).min(axis=(1, 2)).max() > 0


def test_slopes_by_attitude_are_those_of_the_smooth_model():
    structure = model_structure(StructureSettings(harmonic_order=1))
    rng = np.random.default_rng(1)
    motion, weights = rng.uniform(-3, 3, (3, 40, 3)), rng.standard_normal((40, 3, structure.parameters))
    found = regressor_gradient(structure, motion, weights)[0]
    expected = motion_gradient(lambda moved: regressor_of(structure, moved), motion, weights, 1e-5)[0]
    np.testing.assert_allclose(found, expected, atol=0.01 * np.abs(expected).max())
    np.testing.assert_allclose(found[:, 2], 0.0, atol=1e-12)


def test_differences_of_what_is_quadratic_are_exact():
    motion = np.random.default_rng(2).uniform(-1, 1, (3, 10, 3))
    weights = np.random.default_rng(3).uniform(-1, 1, (10, 3))
    found = motion_gradient(lambda moved: moved[1] * moved[2] ** 2, motion, weights, 0.5)
    np.testing.assert_allclose(found[0], 0.0)
    np.testing.assert_allclose(found[1], weights * motion[2] ** 2, atol=1e-14)
    np.testing.assert_allclose(found[2], 2 * weights * motion[1] * motion[2], atol=1e-14)
