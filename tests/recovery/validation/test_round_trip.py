"""A model that is identified predicts what made its flight."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.dynamics import InertiaFunctions, visited_cells
from cpfls_cli.identification import data
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import uniform_chromosome
from cpfls_cli.identification.findings import fit_baselines
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings, ValidationSettings
from cpfls_cli.regressor.regressor import Motion, uniform_breakpoints
from cpfls_cli.validation.bands import bootstrap, inertia_band, missed_torque
from cpfls_cli.validation.residuals import time_blocks
from cpfls_cli.validation.validate import curves, round_trip, simulated_torque
from tests.builders.flights import bent_torque, coloured_noise, random_flight

LENGTH = 800


def bending_flight(noise):
    return random_flight(bent_torque(size=0.5), 113, LENGTH, noise=noise)


def tripped(base, noise, every=1, changed=None):
    settings = IdentificationSettings(base=base)
    training = bending_flight(noise)
    learned = training if every == 1 else training[::every]
    evaluator = model_evaluator(training, learned, settings)
    fit, partitions = evaluator.fit(uniform_chromosome(evaluator.structure)), uniform_breakpoints(evaluator.structure)
    exact, _ = evaluator.solver.exact(partitions, fit)
    visited = visited_cells([training.motion.attitude])
    ranges = evaluator.judge.ranges
    model = InertiaFunctions(evaluator.structure, ranges, partitions, exact.coefficients, exact.rigid_body, visited)
    draws = bootstrap(evaluator, training, model, exact, settings.validation, np.random.default_rng(14))
    best = fit_baselines(learned, exact.row_scale, settings.rank_tolerance)[0].parameters
    drawn = curves(model, draws, best, training)
    drawn = drawn if changed is None else replace(drawn, **changed(drawn))
    return drawn, round_trip(training, learned, settings, model, drawn, np.random.default_rng(15))


@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_without_noise_it_comes_back_whole(base):
    found, again = tripped(base, noise=0.0)
    np.testing.assert_allclose(again.inertia, found.inertia, atol=2e-4)
    zero = np.zeros((3, 3), dtype=bool)
    zero[0, 1] = zero[1, 0] = base == "none"
    np.testing.assert_array_equal(np.isnan(again.inside), zero)


@pytest.mark.parametrize("every", [1, 2], ids=["all", "selection"])
@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_with_noise_it_comes_back_within_the_bands(base, every):
    found, again = tripped(base, noise=0.05, every=every)
    assert np.abs(again.inertia - found.inertia).max() > 1e-4
    assert np.nanmean(again.inside) > 0.8
    np.testing.assert_array_equal(again.inside, again.inside.T)


def test_it_shows_where_it_leaves_the_bands():
    narrow = {"low": 1.0, "high": 1.0}
    _, again = tripped("none", 0.05, changed=lambda c: {name: c.inertia * share for name, share in narrow.items()})
    assert np.nanmax(again.inside) < 0.5
    _, unseen = tripped("none", 0.05, changed=lambda c: {"outside": np.ones_like(c.outside)})
    assert np.isnan(unseen.inside).all()


def test_the_noise_is_what_the_model_missed_turned_over_block_by_block(monkeypatch):
    training = bending_flight(0.05)
    evaluator = model_evaluator(training, training, IdentificationSettings(base="none"))
    fit, partitions = evaluator.fit(uniform_chromosome(evaluator.structure)), uniform_breakpoints(evaluator.structure)
    model = InertiaFunctions(
        evaluator.structure,
        evaluator.judge.ranges,
        partitions,
        fit.coefficients,
        fit.rigid_body,
        np.ones((72, 72), dtype=bool),
    )
    blocks = time_blocks(training, 2.0)
    monkeypatch.setattr(data, "CHUNK", 37)
    factor = np.array([1.0, -1.0, 0.0, 2.0])
    source = simulated_torque(training, model, blocks, factor)
    made = np.concatenate([chunk.torque for chunk in source.chunks()])
    missed = np.concatenate([chunk.torque for chunk in missed_torque(training, model).chunks()])
    np.testing.assert_allclose(missed, training.torque - model.torque(training.motion), atol=1e-12)
    expected = model.torque(training.motion) + np.repeat(factor, 200)[:, None] * missed
    np.testing.assert_allclose(made, expected, atol=1e-12)
    assert len(source) == LENGTH


RUNS, SAMPLES, NOISE = 40, 1200, 0.05
TENSOR = np.diag([0.6, 0.8, 1.2])
NOWHERE = np.zeros((72, 72), dtype=bool)
FAR = np.column_stack([np.deg2rad(np.linspace(60, 120, 20)), np.zeros((20, 2))])
ENTRIES = [(0, 0), (1, 1), (2, 2), (0, 2), (1, 2)]


def tilting(degrees):
    rng, time = np.random.default_rng(11), 0.01 * np.arange(SAMPLES)[:, None, None]
    w, shift = rng.uniform(2, 9, (5, 3)), rng.uniform(0, 2 * np.pi, (5, 3))
    size = rng.uniform(0.3, 1, (5, 3))
    motion = [np.sum(size * w**k * np.sin(w * time + shift + 0.5 * k * np.pi), axis=1) for k in range(3)]
    share = np.deg2rad(degrees) / np.abs(motion[0][:, :2]).max()
    return Motion(*(share * part for part in motion))


def bent_inertia(attitude):
    roll, pitch = attitude[:, 0], attitude[:, 1]
    W = np.eye(3)[None].repeat(len(attitude), axis=0)
    W[:, 0, 2], W[:, 1, 1], W[:, 1, 2] = -np.sin(pitch), np.cos(roll), np.sin(roll) * np.cos(pitch)
    W[:, 2, 1], W[:, 2, 2] = -np.sin(roll), np.cos(roll) * np.cos(pitch)
    inertia = W.swapaxes(1, 2) @ TENSOR @ W
    inertia[:, 1, 1] += 0.3 * np.cos(roll)
    return inertia


def held(m, torque, attitude, rng):
    """Fit a flight under the ridge that it chooses; tell where the bands hold the vehicle."""
    training = TorqueData(0.01 * np.arange(SAMPLES), m, torque)
    evaluator = model_evaluator(training, training, IdentificationSettings())
    fit, partitions = evaluator.fit(uniform_chromosome(evaluator.structure)), uniform_breakpoints(evaluator.structure)
    model = InertiaFunctions(
        evaluator.structure, evaluator.judge.ranges, partitions, fit.coefficients, fit.rigid_body, NOWHERE
    )
    draws = bootstrap(evaluator, training, model, fit, ValidationSettings(draws=100), rng)
    low, high = inertia_band(model, draws, attitude)
    truth = bent_inertia(attitude)
    inside = (low <= truth) & (truth <= high)
    return [inside[:, *place] for place in ENTRIES], fit.ridge_weight


@pytest.mark.parametrize(("tilt", "time_constant"), [(13, 0), (40, 5)], ids=["13-white", "40-coloured"])
def test_coverage_under_a_ridge(tilt, time_constant):
    m, rng = tilting(tilt), np.random.default_rng(21)
    exact, visited = bent_torque(TENSOR, 0.3)(m), slice(0, SAMPLES, 60)
    attitude = np.vstack([m.attitude[visited], FAR])
    found = [
        held(m, exact + NOISE * exact.std(axis=0) * coloured_noise(rng, SAMPLES, time_constant), attitude, rng)
        for _ in range(RUNS)
    ]
    inside, weights = np.array([share for share, _ in found]), np.array([weight for _, weight in found])
    near, far = (np.mean(inside[:, :, where], axis=(0, 2)) for where in (slice(0, 20), slice(20, None)))
    assert np.median(weights) >= 0.01
    assert np.all(np.isfinite(weights))
    assert np.mean(near) > 0.92
    # D11 is one number, inside or not: of 300 flights its band holds 92 % and 89 %, of 40 some five less or more.
    assert min(near[0], far[0]) > 0.8
    assert np.min(near[1:]) > 0.9
    assert np.min(far[1:]) > 0.97
