"""Free runs against another integrator in other coordinates, and the order of their step."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cpfls_cli import rotations
from cpfls_cli.dynamics import (
    RotationState,
    free_runs,
    inertia_matrix,
    inertia_matrix_gradient,
    momentum_form,
    runge_kutta_step,
    turning_law,
)
from cpfls_cli.effects.catalogue.payload import integrate
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import InertiaValues

PARAMETERS = np.array([0.6, 0.7, 1.2, 0.03, -0.02, 0.04])
TENSOR = symmetric(PARAMETERS)
ATTITUDE = np.array([[0.2, -0.3, 0.4], [-0.5, 0.1, 2.0]])
BODY_RATE = np.array([[0.5, -0.4, 0.3], [0.1, 0.8, -0.2]])
TORQUE = np.array([[0.2, -0.1, 0.05], [-0.3, 0.1, 0.1]])


class InEulerCoordinates:
    def inertia(self, attitude):
        return InertiaValues(inertia_matrix(attitude, TENSOR), inertia_matrix_gradient(attitude, TENSOR))


def last(runs):
    *_, end = runs
    return end


def by_euler_angles():
    """Each body by another integrator, in other coordinates: attitudes and body rates at the end."""

    def slope(_, state, torque):
        attitude, body_rate = state[None, :3], state[None, 3:]
        turned = turning_law(PARAMETERS)(attitude, body_rate).acceleration(torque[None])
        return np.concatenate([rotations.attitude_rate(attitude, body_rate)[0], turned[0]])

    ends = [
        solve_ivp(slope, (0.0, 0.5), start, args=(torque,), rtol=1e-11, atol=1e-12).y[:, -1]
        for start, torque in zip(np.hstack([ATTITUDE, BODY_RATE]), TORQUE, strict=True)
    ]
    return np.split(np.array(ends), 2, axis=1)


def by_rotation_matrices(predictor, steps):
    time = np.tile(np.linspace(0.0, 0.5, steps + 1), (2, 1))
    start, beyond = RotationState(rotations.rotation_matrix(ATTITUDE), BODY_RATE), np.zeros(2, dtype=bool)
    torque = np.repeat(TORQUE[:, None], steps + 1, axis=1)
    return last(free_runs(turning_law(predictor), start, beyond, time, torque, fastest=0.0))


@pytest.mark.parametrize("predictor", [PARAMETERS, InEulerCoordinates()], ids=["tensor", "Euler coordinates"])
def test_runs_end_where_another_integrator_ends(predictor):
    (attitude, body_rate), free = by_euler_angles(), by_rotation_matrices(predictor, 200)
    np.testing.assert_allclose(free.body_rate, body_rate, atol=1e-9)
    np.testing.assert_allclose(rotations.euler_angles(free.rotation), attitude, atol=1e-9)


def test_the_step_is_of_fourth_order():
    """Halving the step divides the difference to the next finer solution by 16."""
    coarse, middle, fine = (by_rotation_matrices(PARAMETERS, steps).body_rate for steps in (4, 8, 16))
    ratio = np.abs(coarse - middle).max() / np.abs(middle - fine).max()
    assert np.log2(ratio) == pytest.approx(4.0, abs=0.3)


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
