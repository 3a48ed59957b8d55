import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.dynamics import inertia_matrix, inertia_matrix_gradient, newton_euler_torque, rigid_columns
from cpfls_cli.regressor.regressor import Motion
from tests.builders.christoffel import torque


def vectors(low, high):
    return st.tuples(*[st.floats(low, high)] * 3).map(lambda values: np.array([values]))


attitudes = vectors(-7.0, 7.0)
rates = vectors(-10.0, 10.0)
accelerations = vectors(-50.0, 50.0)


@st.composite
def inertias(draw):
    """Any positive definite tensor: positive principal moments in turned axes."""
    moments = np.array(draw(st.tuples(*[st.floats(0.01, 10.0)] * 3)))
    axes, _ = np.linalg.qr(np.array(draw(st.tuples(*[st.floats(-1.0, 1.0)] * 9))).reshape(3, 3) + 3 * np.eye(3))
    tensor = axes @ np.diag(moments) @ axes.T
    return (tensor + tensor.T) / 2


def elements(inertia):
    return np.concatenate([np.diag(inertia), inertia[[0, 0, 1], [1, 2, 2]]])


def torque_scale(inertia, rate, acceleration):
    """Size of the terms that are added up, which bounds rounding."""
    return np.abs(inertia).max() * (np.abs(acceleration).max() + np.abs(rate).max() ** 2) + 1e-300


@given(attitudes, rates, accelerations, inertias())
def test_christoffel_form_is_newton_and_euler(attitude, rate, acceleration, inertia):
    difference = torque(attitude, rate, acceleration, inertia) - newton_euler_torque(
        attitude, rate, acceleration, inertia
    )
    assert np.abs(difference).max() <= 1e-12 * torque_scale(inertia, rate, acceleration)


@given(attitudes, rates, accelerations, inertias())
def test_regressor_times_inertia_is_the_torque(attitude, rate, acceleration, inertia):
    predicted = rigid_columns(Motion(attitude, rate, acceleration)) @ elements(inertia)
    difference = predicted - torque(attitude, rate, acceleration, inertia)
    assert np.abs(difference).max() <= 1e-12 * torque_scale(inertia, rate, acceleration)


@given(attitudes, inertias())
def test_gradient_agrees_with_finite_differences(attitude, inertia):
    step = 1e-5
    gradient = inertia_matrix_gradient(attitude, inertia)[0]
    for axis in range(3):
        moved = step * np.eye(3)[axis]
        difference = inertia_matrix(attitude + moved, inertia) - inertia_matrix(attitude - moved, inertia)
        np.testing.assert_allclose(gradient[axis], difference[0] / (2 * step), atol=1e-8 * np.abs(inertia).max())
