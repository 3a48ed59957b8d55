"""The momentum of a body, and the step of the integrator beside the compiled one of a load."""

import numpy as np

from cpfls_cli.dynamics.equations_of_motion import momentum_form, runge_kutta_step
from cpfls_cli.dynamics.rigid_body import inertia_matrix, inertia_matrix_gradient
from cpfls_cli.effects.catalogue.payload import integrate
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import InertiaValues

PARAMETERS = np.array([0.6, 0.7, 1.2, 0.03, -0.02, 0.04])
TENSOR = symmetric(PARAMETERS)
ATTITUDE = np.array([[0.2, -0.3, 0.4], [-0.5, 0.1, 2.0]])
BODY_RATE = np.array([[0.5, -0.4, 0.3], [0.1, 0.8, -0.2]])


class InEulerCoordinates:
    def inertia(self, attitude):
        return InertiaValues(inertia_matrix(attitude, TENSOR), inertia_matrix_gradient(attitude, TENSOR))


def test_momentum_form_of_a_rigid_body_is_that_of_newton_and_euler():
    momentum, direct = momentum_form(ATTITUDE, BODY_RATE, InEulerCoordinates().inertia(ATTITUDE))
    np.testing.assert_allclose(momentum, BODY_RATE @ TENSOR, atol=1e-12)
    np.testing.assert_allclose(direct, np.cross(BODY_RATE, BODY_RATE @ TENSOR), atol=1e-12)


def swing(state, felt, length=0.7, damping=0.2):
    """A cable under a hook."""
    direction, rate = state[:3], state[3:]
    across = felt - (felt @ direction) * direction
    return np.concatenate([rate, -across / length - (rate @ rate) * direction - damping * rate])


def taut(state):
    """Keep its direction at length 1."""
    direction = state[:3] / np.linalg.norm(state[:3])
    return np.concatenate([direction, state[3:] - (state[3:] @ direction) * direction])


def test_the_compiled_swing_of_a_load_takes_the_same_steps():
    felt = np.array([0.0, 0.0, 9.81]) + np.random.default_rng(8).standard_normal((41, 3))
    found = integrate(
        np.ascontiguousarray(felt[::2]),
        np.ascontiguousarray(felt[1::2]),
        0.04,
        0.7,
        0.2,
        np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]),
    )
    state = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
    for number in range(20):
        state = taut(runge_kutta_step(swing, state, tuple(felt[2 * number : 2 * number + 3]), 0.04))
        np.testing.assert_allclose(found[number + 1], state, atol=1e-12)
