"""Steps of a vehicle model, and its accelerations."""

import numpy as np
import pytest

from cpfls_cli.effects import scales
from cpfls_cli.playback.flight import MeasuredMotion, State
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import one_step
from cpfls_cli.playback.windows import Runs, Steps, errors_of_runs
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.vehicle.rotors import rotor_demand
from tests.builders.vehicle_models import HEXA, QUAD, accelerations, whole

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


def test_a_run_is_one_step_after_another(model):
    """A run over a flight is held against the steps themselves: what is left is rounding."""
    rotor = model.response.terms_by_step(speeds(model, 12), PERIOD, "linear")
    path = [State(*(part[:1] for part in states(1)))]
    for row in rotor[:-1]:
        path.append(one_step(model, path[-1], row[None], PERIOD))
    motion = MeasuredMotion(*(np.concatenate(parts) for parts in zip(*path, strict=True)), PERIOD)
    runs = Runs(motion, np.zeros(1, dtype=np.int64), translates=True)
    errors, diverged = errors_of_runs(model.flown, runs, Steps(rotor[:-1, None]))
    assert diverged.tolist() == [-1]
    assert np.abs(errors).max() < 1e-12


def test_a_short_step_is_the_acceleration(model):
    state, rotor = states(5), model.response.terms_by_step(speeds(model, 5), PERIOD, "previous")
    linear, angular = np.split(accelerations(model, state, rotor), 2, axis=1)
    moved = one_step(model, state, rotor, 1e-6)
    np.testing.assert_allclose((moved.velocity - state.velocity) / 1e-6, linear, rtol=0, atol=1e-4 * abs(linear).max())
    np.testing.assert_allclose((moved.rate - state.rate) / 1e-6, angular, rtol=0, atol=1e-4 * abs(angular).max())


def test_a_vehicle_at_hover_stays(model):
    plain = VehicleModel(vehicle=model.vehicle)
    speed = rotor_demand(model.vehicle, np.array([model.vehicle.mass_kg * 9.81]), np.zeros((1, 3))).speed
    still = State(np.zeros((1, 3)), np.zeros((1, 3)), np.eye(3)[None], np.zeros((1, 3)))
    moved = one_step(plain, still, plain.response.terms_by_step(speed, PERIOD, "previous"), PERIOD)
    for now, before in zip(moved, still, strict=True):
        np.testing.assert_allclose(now, before, rtol=0, atol=1e-12)
