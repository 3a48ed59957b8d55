"""Flights for playback, steps of a vehicle model along them, and what acts at samples and between them."""

import gc
import pickle
from typing import Any
from weakref import ref

import numpy as np
import pytest

from cpfls_cli.effects import scales
from cpfls_cli.effects.signals import Signals, stretch_of
from cpfls_cli.gap.residual.air import known_motion
from cpfls_cli.playback.flight import MeasuredMotion, State, playback_flight
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import one_step
from cpfls_cli.playback.rotors import RotorResponse, rotor_terms_by_step
from cpfls_cli.playback.windows import Runs, Steps, errors_of_runs
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.vehicle.rotors import rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.vehicle_models import HEXA, QUAD, accelerations, whole

MODELS = {"quad": whole(), "hexa, seesaw": whole(HEXA, order=0), "plain": VehicleModel(vehicle=QUAD)}
PERIOD = 0.01
FINER = 50
RESPONSE = RotorResponse(delay_s=0.014, lag_s=0.03, slow_s=0.2)


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


def _part(first: int, count: int, **setpoints: Any) -> Signals:
    time = 0.01 * np.arange(first, first + count)
    vehicle = VehicleSettings()
    speed = np.full((count, len(vehicle.rotors)), 100.0)
    return Signals(time=time, body_rate=np.zeros((count, 3)), vehicle=vehicle, rotor_speed=speed, setpoints=setpoints)


def test_setpoints_are_joined_where_all_stretches_know_them() -> None:
    wished = np.arange(60.0).reshape(20, 3)
    parts = [_part(0, 12, attitude=wished[:12], thrust=np.ones((12, 1))), _part(30, 8, attitude=wished[12:])]
    flight = playback_flight(parts, "linear")
    assert (list(flight.setpoints), flight.setpoints["attitude"]) == (["attitude"], pytest.approx(wished))


def test_a_part_of_a_flight_has_its_part_of_the_setpoints_or_none():
    wished = np.arange(36.0).reshape(12, 3)
    part = stretch_of(_part(0, 12, body_rate=wished), slice(3, 9))
    assert part.setpoints["body_rate"] == pytest.approx(wished[3:9])
    assert playback_flight([_part(0, 12)], "linear").setpoints == {}


def test_flights_are_freed_when_nobody_uses_them_any_more() -> None:
    logged = [_part(0, 200), _part(300, 200)]
    flight = playback_flight(logged[:1], "linear")
    assert flight.rotor_terms(0.0, 0.01, None) is flight.rotor_terms(0.0, 0.01, None)
    assert known_motion(logged) is known_motion(logged)
    freed = [ref(each) for each in (*logged, flight)]
    gc.disable()
    try:
        del logged, flight
        assert [each() for each in freed] == [None] * 3
    finally:
        gc.enable()


def test_a_copy_of_a_flight_has_nothing_that_was_made_of_it() -> None:
    logged = [_part(0, 200), _part(300, 200)]
    known_motion(logged)
    assert "made" not in vars(pickle.loads(pickle.dumps(logged[0])))


def two_speeds(period, duration=2.0):
    time = np.arange(round(duration / period) + 1) * period
    return np.stack([900 + 150 * np.sin(9 * time), 1000 - 200 * np.cos(14 * time)], axis=1)


@pytest.mark.parametrize("response", [RotorResponse(), RESPONSE])
def test_at_a_sample_the_terms_are_those_of_a_short_step_there(response):
    """Steps a fiftieth as long begin at the sample; half of one is between their mean and it."""
    coarse = response.terms_at_samples(two_speeds(PERIOD), PERIOD, "linear")
    fine = rotor_terms_by_step(
        two_speeds(PERIOD / FINER), PERIOD / FINER, "linear", response.delay_s, response.lag_s, response.slow_s
    )[::FINER]
    # Slow actuation forgets in which step it began.
    late = slice(150, -2)
    size = np.abs(fine[late]).max(axis=0)
    assert (np.abs(coarse[late] - fine[late]).max(axis=0) < 0.02 * size).all()
    assert (np.abs(coarse[late, 1:5] - fine[late, 1:5]).max(axis=0) < 2e-3 * size[1:5]).all()


def test_speeds_that_stay_until_the_next_sample_jump_at_it_but_behind_a_lag():
    terms = RotorResponse().terms_at_samples(np.array([[100.0], [100.0], [140.0], [140.0]]), PERIOD, "previous")
    assert terms[:, 1].tolist() == [100.0, 100.0, 120.0, 140.0]
    assert terms[:, 2].tolist() == [1e4, 1e4, 120.0**2, 140.0**2]
    step = np.where(np.arange(60) < 20, 100.0, 140.0)[:, None]
    found = RotorResponse(lag_s=0.05).terms_at_samples(step, PERIOD, "previous")[:, 1]
    since = np.maximum(np.arange(60) - 20, 0) * PERIOD
    assert found == pytest.approx(140 - 40 * np.exp(-since / 0.05), abs=1e-9)
