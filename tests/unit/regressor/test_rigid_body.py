"""The harmonic system of order 2, tensor products, one rule, contains every rigid body with principal axes."""

import numpy as np
import pytest

from cpfls_cli.dynamics import newton_euler_torque
from cpfls_cli.regressor.regressor import Motion, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure


def relative_residual(tensor, **settings):
    """Largest error of the best coefficients over the largest torque, on random states of the whole circle."""
    rng = np.random.default_rng(11)
    states = rng.uniform(-np.pi, np.pi, (300, 3)), rng.standard_normal((300, 3)), rng.standard_normal((300, 3))
    structure = model_structure(StructureSettings(**settings))
    Q = Regressor(structure, Motion(*states), data_ranges(structure, states[0])).matrix(uniform_breakpoints(structure))
    torque = newton_euler_torque(*states, np.array(tensor)).ravel()
    columns = Q.reshape(len(torque), -1)
    coefficients = np.linalg.lstsq(columns, torque, rcond=1e-12)[0]
    return np.abs(columns @ coefficients - torque).max() / np.abs(torque).max()


@pytest.mark.parametrize("moments", [(0.6, 0.6, 1.2), (0.3, 0.9, 1.1)])
def test_order_2_tensor_is_exact(moments):
    assert relative_residual(np.diag(moments)) < 1e-12


@pytest.mark.parametrize("settings", [{"harmonic_order": 1}, {"products": "additive"}])
def test_less_is_not(settings):
    assert relative_residual(np.diag((0.3, 0.9, 1.1)), **settings) > 0.05


def test_products_of_inertia_are_outside_the_structure():
    """D12 is zero in equation (15), and D11 and D22 depend on nothing more; method.md section 2."""
    assert relative_residual([[0.6, 0.1, 0.0], [0.1, 0.7, 0.0], [0.0, 0.0, 1.2]]) > 0.05
