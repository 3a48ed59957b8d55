"""The two kinds of runs beside each other: other unknowns and other sums, but one step and one motion."""

import numpy as np
import pytest

from cpfls_cli import rotations
from cpfls_cli.dynamics.equations_of_motion import RotationState, acceleration_law, momentum_form, rigid_plant
from cpfls_cli.dynamics.integration import advance, free_runs, runge_kutta_step
from cpfls_cli.dynamics.rigid_body import inertia_matrix, inertia_matrix_gradient
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


def by_euler_angles(steps):
    state = np.hstack([ATTITUDE, BODY_RATE])
    return advance(rigid_plant(TENSOR), state, lambda _: TORQUE, 0.5, steps)


def by_rotation_matrices(predictor, steps):
    time = np.tile(np.linspace(0.0, 0.5, steps + 1), (2, 1))
    exists = np.ones(2, dtype=bool)
    start = RotationState(rotations.rotation_matrix(ATTITUDE), BODY_RATE, ~exists, exists)
    torque = np.repeat(TORQUE[:, None], steps + 1, axis=1)
    return last(free_runs(acceleration_law(predictor), start, time, torque, fastest=0.0))


@pytest.mark.parametrize("predictor", [PARAMETERS, InEulerCoordinates()], ids=["tensor", "Euler coordinates"])
def test_both_kinds_of_runs_come_to_the_same_end(predictor):
    end, free = by_euler_angles(200), by_rotation_matrices(predictor, 200)
    assert free.exists.all()
    np.testing.assert_allclose(free.body_rate, end[:, 3:], atol=1e-9)
    np.testing.assert_allclose(rotations.euler_angles(free.rotation), end[:, :3], atol=1e-9)


@pytest.mark.parametrize(
    "body_rate",
    [
        lambda steps: by_euler_angles(steps)[:, 3:],
        lambda steps: by_rotation_matrices(PARAMETERS, steps).body_rate,
    ],
    ids=["Euler angles", "rotation matrices"],
)
def test_the_step_is_of_fourth_order(body_rate):
    """Halving the step divides the difference to the next finer solution by 16."""
    coarse, middle, fine = (body_rate(steps) for steps in (4, 8, 16))
    ratio = np.abs(coarse - middle).max() / np.abs(middle - fine).max()
    assert np.log2(ratio) == pytest.approx(4.0, abs=0.3)


def test_momentum_form_of_a_rigid_body_is_that_of_newton_and_euler():
    momentum, direct = momentum_form(ATTITUDE, BODY_RATE, InEulerCoordinates().inertia(ATTITUDE))
    np.testing.assert_allclose(momentum, BODY_RATE @ TENSOR, atol=1e-12)
    np.testing.assert_allclose(direct, np.cross(BODY_RATE, BODY_RATE @ TENSOR), atol=1e-12)


class Swing:
    """A cable under a hook, with its direction kept at length 1 by the state."""

    def __init__(self, step, length, damping):
        self.step, self.length, self.damping = step, length, damping

    def slope(self, state, felt):
        direction, rate = state[:3], state[3:]
        across = felt - (felt @ direction) * direction
        return np.concatenate([rate, -across / self.length - (rate @ rate) * direction - self.damping * rate])

    def moved(self, state, slope, share):
        return state + share * self.step * slope

    def joined(self, state, slopes):
        first, second, third, fourth = slopes
        after = state + self.step / 6 * (first + 2 * (second + third) + fourth)
        direction = after[:3] / np.linalg.norm(after[:3])
        return np.concatenate([direction, after[3:] - (after[3:] @ direction) * direction])


def test_the_compiled_swing_of_a_load_takes_the_same_steps():
    felt = np.array([0.0, 0.0, 9.81]) + np.random.default_rng(8).standard_normal((41, 3))
    found = integrate(np.ascontiguousarray(felt[::2]), np.ascontiguousarray(felt[1::2]), 0.04, 0.7, 0.2)
    state = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
    for number in range(20):
        state = runge_kutta_step(Swing(0.04, 0.7, 0.2), state, tuple(felt[2 * number : 2 * number + 3]))
        np.testing.assert_allclose(found[number + 1], state, atol=1e-12)
