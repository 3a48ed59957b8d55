"""Equations of motion, inertia over the attitude, and their integration."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from cpfls_cli import rotations
from cpfls_cli.dynamics import (
    InertiaFunctions,
    RotationState,
    coriolis_matrix,
    free_runs,
    inertia_matrix,
    inertia_matrix_gradient,
    momentum_form,
    runge_kutta_step,
    turning_law,
    visited_cells,
)
from cpfls_cli.effects.catalogue.payload import integrate
from cpfls_cli.identification.evaluator import decode
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.regressor import InertiaValues, Motion, data_ranges
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from tests.builders.christoffel import torque

PARAMETERS = np.array([0.6, 0.7, 1.2, 0.02, -0.01, 0.03])
INERTIA = symmetric(PARAMETERS)
angles = st.lists(st.floats(-1.2, 1.2), min_size=3, max_size=3).map(np.array)
MOMENTS = 0.6, 0.7, 1.2


class Rigid:
    def inertia(self, attitude):
        return InertiaValues(inertia_matrix(attitude, INERTIA), inertia_matrix_gradient(attitude, INERTIA))


class Warped:
    """An inertia that no rigid body has: it grows with the pitch."""

    def inertia(self, attitude):
        grown = (1 + attitude[:, 1] ** 2)[:, None, None] * np.eye(3)
        gradient = np.zeros((len(attitude), 3, 3, 3))
        gradient[:, 1] = 2 * attitude[:, 1, None, None] * np.eye(3)
        return InertiaValues(grown, gradient)


@given(angles, angles)
def test_rigid_body_in_both_coordinates(attitude, body_rate):
    own, other = (turning_law(each)(attitude[None], body_rate[None]) for each in (PARAMETERS, Rigid()))
    np.testing.assert_allclose(other.inertia, own.inertia, atol=1e-12)
    np.testing.assert_allclose(other.direct, own.direct, atol=1e-12)


@given(angles, angles)
def test_kinetic_energy_grows_by_the_work_of_the_torque(attitude, body_rate):
    """Without a torque the energy ``1/2 qd^T J qd`` stays, by central differences along the motion."""
    (turning,) = turning_law(Warped())(attitude[None], body_rate[None]).acceleration(np.zeros((1, 3)))
    rate = rotations.attitude_rate(attitude[None], body_rate[None])[0]

    def energy(step):
        q = (attitude + step * rate)[None]
        qd = rotations.attitude_rate(q, (body_rate + step * turning)[None])[0]
        return 0.5 * qd @ Warped().inertia(q).value[0] @ qd

    assert (energy(1e-5) - energy(-1e-5)) / 2e-5 == pytest.approx(0.0, abs=1e-5)


def random_attitudes(count):
    return np.random.default_rng(7).uniform(-np.pi, np.pi, (count, 3))


def test_inertia_matrix_has_the_printed_components():
    attitude = random_attitudes(200)
    roll, pitch, _ = attitude.T
    xx, yy, zz = MOMENTS
    J = inertia_matrix(attitude, np.diag(MOMENTS))
    for (row, column), component in {
        (0, 0): np.full_like(roll, xx),
        (0, 1): np.zeros_like(roll),
        (0, 2): -xx * np.sin(pitch),
        (1, 1): yy * np.cos(roll) ** 2 + zz * np.sin(roll) ** 2,
        (1, 2): (yy - zz) * np.cos(roll) * np.sin(roll) * np.cos(pitch),
        (2, 2): xx * np.sin(pitch) ** 2
        + yy * np.sin(roll) ** 2 * np.cos(pitch) ** 2
        + zz * np.cos(roll) ** 2 * np.cos(pitch) ** 2,
    }.items():
        np.testing.assert_allclose(J[:, row, column], component, atol=1e-15)
        np.testing.assert_allclose(J[:, column, row], component, atol=1e-15)


def test_pitch_term_of_yaw_rate_is_half_the_slope_of_d33():
    """Equation (16) prints D_223 where (4) gives D_233 = -1/2 dD33/dtheta."""
    attitude = random_attitudes(50)
    roll, pitch, _ = attitude.T
    xx, yy, zz = MOMENTS
    slope = 2 * np.sin(pitch) * np.cos(pitch) * (xx - yy * np.sin(roll) ** 2 - zz * np.cos(roll) ** 2)
    turning = np.broadcast_to([0.0, 0.0, 2.0], attitude.shape)
    pitch_torque = torque(attitude, turning, np.zeros_like(attitude), np.diag(MOMENTS))[:, 1]
    np.testing.assert_allclose(pitch_torque, -0.5 * slope * 4, atol=1e-14)


def test_a_level_body_accelerates_by_its_own_moments():
    zero = np.zeros((1, 3))
    np.testing.assert_allclose(torque(zero, zero, np.ones((1, 3)), np.diag(MOMENTS)), [MOMENTS])


STRUCTURES = {
    "seesaw": {"consequents": "seesaw", "products": "additive", "membership_functions": 5},
    "data-range": {
        "consequents": "seesaw",
        "products": "additive",
        "membership_functions": 3,
        "input_map": "data-range",
    },
    "classic": {"consequents": "seesaw", "products": "additive", "membership_functions": 3, "structure": "fls"},
    "harmonic": {"membership_functions": (1, 4, 2, 3, 5, 1)},
}


@pytest.fixture(params=STRUCTURES)
def case(request):
    """A model with random coefficients over a random rigid body, and a motion."""
    rng = np.random.default_rng(19)
    structure = model_structure(StructureSettings(**STRUCTURES[request.param]))
    attitude = rng.uniform(-np.pi, np.pi, (50, 3))
    return InertiaFunctions(
        structure,
        data_ranges(structure, attitude),
        decode(structure, rng.uniform(1, 2, structure.genes)),
        rng.standard_normal(structure.parameters),
        rng.standard_normal(6),
        visited_cells([attitude]),
    ), Motion(attitude, *rng.standard_normal((2, 50, 3)))


def test_torque_is_inertial_plus_coriolis(case):
    model, motion = case
    inertial = np.einsum("nij,nj->ni", model.inertia(motion.attitude).value, motion.acceleration)
    coriolis = np.einsum("nij,nj->ni", coriolis_matrix(model.inertia(motion.attitude), motion.rate), motion.rate)
    np.testing.assert_allclose(inertial + coriolis, model.torque(motion), atol=1e-10)


def test_coriolis_forces_do_no_work_of_their_own(case):
    """qd^T (dJ/dt - 2 C) qd = 0; stronger, dJ/dt - 2 C is skew-symmetric."""
    model, motion = case
    inertia = model.inertia(motion.attitude)
    np.testing.assert_allclose(inertia.value, inertia.value.swapaxes(1, 2), atol=1e-14)
    skew = np.einsum("nkij,nk->nij", inertia.gradient, motion.rate) - 2 * coriolis_matrix(inertia, motion.rate)
    np.testing.assert_allclose(skew + skew.swapaxes(1, 2), 0.0, atol=1e-11)
    assert np.abs(skew).max() > 0.1


def test_gradient_of_inertia(case):
    model, motion = case
    step = 1e-6
    for angle, unit in enumerate(np.eye(3)):
        ahead, behind = (model.inertia(motion.attitude + s * step * unit).value for s in (1, -1))
        gradient = model.inertia(motion.attitude).gradient[:, angle]
        np.testing.assert_allclose(gradient, (ahead - behind) / (2 * step), atol=1e-3)


def test_coriolis_matrix_by_the_sum_of_christoffel_symbols(case):
    model, motion = case
    inertia = model.inertia(motion.attitude)
    D, qd, n = inertia.gradient, motion.rate, 7
    expected = [
        [sum(0.5 * (D[n, k, i, j] + D[n, j, i, k] - D[n, i, j, k]) * qd[n, k] for k in range(3)) for j in range(3)]
        for i in range(3)
    ]
    np.testing.assert_allclose(coriolis_matrix(inertia, qd)[n], expected, atol=1e-12)


def test_long_motions_are_predicted_in_parts_and_attitudes_outside_training_are_flagged(case):
    model, motion = case
    many = np.arange(9000) % 50
    np.testing.assert_allclose(model.torque(motion[many]), model.torque(motion)[many], atol=1e-12)
    model, motion = case
    assert not model.outside(motion.attitude).any()
    assert model.outside(np.random.default_rng(20).uniform(-np.pi, np.pi, (500, 3))).any()


def test_one_rule_learned_all_round_the_circle_is_the_same_everywhere():
    circle = np.linspace(-np.pi, np.pi, 200)
    round_both = np.column_stack([circle, 2 * circle, 0 * circle])
    near_hover, round_roll = 0.1 * round_both, round_both * [1.0, 0.1, 1.0]

    def model(attitude, functions):
        structure = model_structure(StructureSettings(membership_functions=functions))
        partitions = decode(structure, np.ones(structure.genes))
        ranges, visited = data_ranges(structure, attitude), visited_cells([attitude])
        return InertiaFunctions(structure, ranges, partitions, np.zeros(structure.parameters), np.ones(6), visited)

    assert model(round_both, 1).same_everywhere
    assert model(round_both, 1).outside(np.array([[0.0, 2.0, 0.0]])).all()
    assert not model(round_both, 3).same_everywhere
    assert not model(near_hover, 1).same_everywhere
    assert not model(round_roll, 1).same_everywhere


BODY = np.array([0.6, 0.7, 1.2, 0.03, -0.02, 0.04])
TENSOR = symmetric(BODY)
ATTITUDE = np.array([[0.2, -0.3, 0.4], [-0.5, 0.1, 2.0]])
BODY_RATE = np.array([[0.5, -0.4, 0.3], [0.1, 0.8, -0.2]])
TORQUE = np.array([[0.2, -0.1, 0.05], [-0.3, 0.1, 0.1]])


class InEulerCoordinates:
    def inertia(self, attitude):
        return InertiaValues(inertia_matrix(attitude, TENSOR), inertia_matrix_gradient(attitude, TENSOR))


def by_euler_angles():
    """Each body by another integrator, in other coordinates: attitudes and body rates at the end."""

    def slope(_, state, torque):
        attitude, body_rate = state[None, :3], state[None, 3:]
        turned = turning_law(BODY)(attitude, body_rate).acceleration(torque[None])
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
    *_, end = free_runs(turning_law(predictor), start, beyond, time, torque, fastest=0.0)
    return end


@pytest.mark.parametrize("predictor", [BODY, InEulerCoordinates()], ids=["tensor", "Euler coordinates"])
def test_runs_end_where_another_integrator_ends(predictor):
    (attitude, body_rate), free = by_euler_angles(), by_rotation_matrices(predictor, 200)
    np.testing.assert_allclose(free.body_rate, body_rate, atol=1e-9)
    np.testing.assert_allclose(rotations.euler_angles(free.rotation), attitude, atol=1e-9)


def test_the_step_is_of_fourth_order():
    """Halving the step divides the difference to the next finer solution by 16."""
    coarse, middle, fine = (by_rotation_matrices(BODY, steps).body_rate for steps in (4, 8, 16))
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
