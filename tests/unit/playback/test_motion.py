"""Accelerations and steps of a vehicle model are those of the compiled loops, and rotor speeds come back."""

import numpy as np
import pytest

from cpfls_cli.effects import scales
from cpfls_cli.playback.kernels import MeasuredMotion, errors_of_runs
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.motion import State, accelerations, rotor_speeds, step
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.vehicle.rotors import rotor_demand
from tests.builders.vehicle_models import HEXA, QUAD, whole

MODELS = {"quad": whole(), "hexa, seesaw": whole(HEXA, order=0), "plain": VehicleModel(vehicle=QUAD)}
PERIOD = 0.01


@pytest.fixture(params=MODELS)
def model(request):
    return MODELS[request.param]


def speeds(model, count, seed=0, spread=0.3):
    rng = np.random.default_rng(seed)
    return scales.hover_speed(model.vehicle) * rng.uniform(1 - spread, 1 + spread, (count, model.rotors))


def states(count, seed=1):
    rng = np.random.default_rng(seed)
    rotation = rotation_matrix(rng.uniform(-2, 2, (count, 3)))
    return State(rng.normal(0, 3, (count, 3)), rng.normal(0, 3, (count, 3)), rotation, rng.normal(0, 3, (count, 3)))


def test_a_step_is_that_of_the_compiled_loops(model):
    """A run over a flight is held against the steps themselves: what is left is rounding."""
    rotor = model.response.terms_by_step(speeds(model, 12), PERIOD, "linear")
    path = [State(*(part[:1] for part in states(1)))]
    for row in rotor[:-1]:
        path.append(step(model, path[-1], row[None], PERIOD))
    motion = MeasuredMotion(*(np.concatenate(parts) for parts in zip(*path, strict=True)), PERIOD)
    used, weights = model.table.by_step(rotor)
    errors = np.zeros((1, len(path) - 1, 4, 3))
    starts = np.zeros(1, dtype=np.int64)
    assert errors_of_runs(motion, model.body, used, weights, starts, True, errors).tolist() == [-1]
    assert np.abs(errors).max() < 1e-12


def test_a_short_step_is_the_acceleration(model):
    state, rotor = states(5), model.response.terms_by_step(speeds(model, 5), PERIOD, "previous")
    linear, angular = accelerations(model, state, rotor)
    moved = step(model, state, rotor, 1e-6)
    np.testing.assert_allclose((moved.velocity - state.velocity) / 1e-6, linear, rtol=0, atol=1e-4 * abs(linear).max())
    np.testing.assert_allclose((moved.rate - state.rate) / 1e-6, angular, rtol=0, atol=1e-4 * abs(angular).max())


def test_a_vehicle_at_hover_stays(model):
    plain = VehicleModel(vehicle=model.vehicle)
    speed = rotor_demand(model.vehicle, np.array([model.vehicle.mass_kg * 9.81]), np.zeros((1, 3))).speed
    still = State(np.zeros((1, 3)), np.zeros((1, 3)), np.eye(3)[None], np.zeros((1, 3)))
    moved = step(plain, still, plain.response.terms_by_step(speed, PERIOD, "previous"), PERIOD)
    for now, before in zip(moved, still, strict=True):
        np.testing.assert_allclose(now, before, rtol=0, atol=1e-12)


def steady(speed, slow=None):
    """Terms of rotors that keep their speed."""
    late = np.zeros_like(speed) if slow is None else slow - speed**2
    return np.hstack([np.ones((len(speed), 1)), speed, speed**2, np.zeros_like(speed), late])


@pytest.mark.parametrize("behind", [False, True], ids=["settled", "slow actuation"])
def test_rotor_speeds_of_a_wrench_give_that_wrench(model, behind):
    count = 400
    speed, state = speeds(model, count), states(count)
    slow = speeds(model, count, 5) ** 2 if behind else None
    wanted = model.table.wrench(state.velocity, state.rate, steady(speed, slow))
    found = rotor_speeds(model, state.velocity, state.rate, wanted[:, 5], wanted[:, :3], slow)
    assert np.isfinite(found).all()
    given = model.table.wrench(state.velocity, state.rate, steady(found, slow))[:, [0, 1, 2, 5]]
    size = np.abs(wanted[:, [0, 1, 2, 5]]).max(axis=0)
    assert np.max(np.abs(given - wanted[:, [0, 1, 2, 5]]) / size) < 1e-8
    if model.rotors == 4:
        np.testing.assert_allclose(found, speed, rtol=1e-7)


def test_rotors_alone_need_the_speeds_of_their_allocation():
    model = VehicleModel(vehicle=HEXA)
    rng, still = np.random.default_rng(2), np.zeros((50, 3))
    thrust, torque = rng.uniform(10, 30, 50), rng.uniform(-0.02, 0.02, (50, 3))
    demand = rotor_demand(HEXA, thrust, torque)
    found = rotor_speeds(model, still, still, thrust, torque)
    np.testing.assert_allclose(found, demand.speed, rtol=1e-10)


def test_where_no_speeds_exist_there_are_none():
    model, still = whole(), np.zeros((5, 3))
    weight = QUAD.mass_kg * QUAD.gravity_m_s2
    thrust = np.array([weight, -weight, 1e3 * weight, np.nan, weight])
    torque = np.zeros((5, 3))
    torque[4, 0] = 10.0
    found = rotor_speeds(model, still, still, thrust, torque)
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1:]).all()


def test_a_vehicle_that_stands_still_needs_no_speed():
    model = VehicleModel(vehicle=QUAD)
    found = rotor_speeds(model, np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1), np.zeros((1, 3)))
    assert found.tolist() == [[0.0] * 4]
