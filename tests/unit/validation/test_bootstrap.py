"""Draws against least squares of rows written out, with errors turned over block by block."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from cpfls_cli.dynamics import InertiaFunctions, rigid_columns
from cpfls_cli.identification import data
from cpfls_cli.identification.data import axis_scale
from cpfls_cli.identification.evaluator import decode, uniform_chromosome
from cpfls_cli.identification.findings import fit_baselines
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings, ValidationSettings
from cpfls_cli.regressor.regressor import RIGID, Regressor
from cpfls_cli.validation.bands import bootstrap
from tests.builders.flights import bent_torque, random_flight

DRAWS = 30
VALIDATION = ValidationSettings(draws=DRAWS)
STRUCTURE = {"harmonic_order": 1, "products": "additive"}
SAMPLES, BLOCKS = 200, 10
NOWHERE = np.zeros((72, 72), dtype=bool)


def bending_flight(bent, noise=0.05):
    """Torque of a rigid body, or of one with 0.5 cos(roll) added to D22."""
    return random_flight(bent_torque(size=0.5 * bent), 3, SAMPLES, noise=noise)


def fitted(training, learned, base):
    evaluator = model_evaluator(training, learned, IdentificationSettings(**STRUCTURE, base=base))
    structure, chromosome = evaluator.structure, uniform_chromosome(evaluator.structure)
    fit, partitions = evaluator.fit(chromosome), decode(structure, chromosome.astype(float))
    model = InertiaFunctions(structure, evaluator.judge.ranges, partitions, fit.coefficients, fit.rigid_body, NOWHERE)
    return evaluator, model, fit


def drawn(training, learned, base, seed=4):
    evaluator, model, fit = fitted(training, learned, base)
    return bootstrap(evaluator, training, model, fit, VALIDATION, np.random.default_rng(seed)), model, fit


def brute_force(A, penalty, y, label):
    """Turn the corrected errors of each block over and solve all rows again, under the weakest penalty."""
    blocks, rng, held = label[-1] + 1, np.random.default_rng(4), penalty > 0
    weights, hidden = rng.standard_normal((DRAWS, blocks)), rng.standard_normal((DRAWS, 1))
    prior = np.zeros((DRAWS, len(held)))
    prior[:, held] = rng.standard_normal((DRAWS, held.sum()))

    def solve(torque, penalty):
        return linalg.lstsq(np.vstack([A, np.diag(np.sqrt(penalty))]), np.append(torque, np.zeros(A.shape[1])))[0]

    x = solve(y, penalty)
    weakest = held * np.mean((y - A @ x) ** 2)
    least = solve(y, weakest)
    inverse, corrected = np.linalg.inv(A.T @ A + np.diag(weakest)), np.zeros((blocks, len(y)))
    for block in range(blocks):
        rows = label == block
        values, vectors = np.linalg.eigh(np.eye(rows.sum()) - A[rows] @ inverse @ A[rows].T)
        corrected[block, rows] = vectors @ (values**-0.75 * (vectors.T @ (y - A @ least)[rows]))
    moved = np.array([solve(errors, weakest) for errors in weights @ corrected])
    left = np.array([z - solve(A @ z, weakest) for z in prior])
    return x, x + moved + left + 0.75 * hidden * (least - x)


@pytest.mark.parametrize("every", [1, 3], ids=["all", "selection"])
@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_draws_are_those_of_all_rows_solved_again(base, every):
    training = bending_flight(bent=1.0)
    learned = training[::every]
    draws, model, fit = drawn(training, learned, base)
    assert np.isfinite(fit.ridge_weight)
    label = np.repeat(np.arange(SAMPLES) // (SAMPLES // BLOCKS), 3).reshape(-1, 3)[::every].ravel()
    scale = np.ones(3) if base == "none" else 1 / axis_scale(learned)
    Q = Regressor(model.structure, learned.motion, model.ranges).matrix(model.partitions) / fit.column_size
    rigid = rigid_columns(learned.motion)
    parts = [Q] if base == "none" else [rigid, Q]
    A = (np.concatenate(parts, axis=2) * scale[:, None]).reshape(label.size, -1)
    y = (learned.torque * scale).ravel()
    penalty = np.full(A.shape[1], fit.ridge_weight * len(y))
    first = A.shape[1] - model.structure.parameters
    penalty[:first] = 0.0
    x, expected = brute_force(A, penalty, y, label)
    np.testing.assert_allclose(model.coefficients, x[first:] / fit.column_size, atol=1e-8)
    np.testing.assert_allclose(draws.coefficients, expected[:, first:] / fit.column_size, atol=1e-8)
    np.testing.assert_allclose(draws.rigid_body, expected[:, :first] if first else np.zeros((DRAWS, 6)), atol=1e-8)
    best, expected = brute_force((rigid * scale[:, None]).reshape(-1, RIGID), np.zeros(RIGID), y, label)
    np.testing.assert_allclose(fit_baselines(learned, fit.row_scale, 1e-10)[0].parameters, best, atol=1e-10)
    np.testing.assert_allclose(draws.best_rigid_body, expected, atol=1e-9)
    assert (draws.blocks, draws.block_duration) == (BLOCKS, pytest.approx(0.2))


def test_a_fuzzy_part_that_is_off_stays_off():
    training = bending_flight(bent=0.0, noise=0.2)
    draws, model, fit = drawn(training, training, "rigid-body")
    assert np.isinf(fit.ridge_weight)
    np.testing.assert_array_equal(draws.coefficients, np.zeros((DRAWS, len(model.coefficients))))
    np.testing.assert_allclose(draws.rigid_body, draws.best_rigid_body, atol=1e-12)


@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_a_seed_gives_the_same_draws_and_chunks_change_nothing(base, monkeypatch):
    training = bending_flight(bent=1.0)
    once, model, _ = drawn(training, training, base)
    other, _, _ = drawn(training, training, base, seed=5)
    assert np.abs(once.coefficients - other.coefficients).max() > 1e-4
    monkeypatch.setattr(data, "CHUNK", 37)
    again, _, _ = drawn(training, training, base)
    for name in ("coefficients", "rigid_body", "best_rigid_body"):
        np.testing.assert_allclose(getattr(once, name), getattr(again, name), rtol=0, atol=1e-7)
    assert once.coefficients.shape == (DRAWS, len(model.coefficients))


@pytest.mark.parametrize("base", ["none", "rigid-body"])
@pytest.mark.parametrize("samples", [12, 45, 200])
def test_noise_free_data_and_short_flights_give_finite_draws(base, samples):
    training = bending_flight(bent=0.0, noise=0.0)[:samples]
    settings = IdentificationSettings(**STRUCTURE, base=base)
    settings = replace(settings, ridge=replace(settings.ridge, embargo_s=0.0))
    evaluator = model_evaluator(training, training, settings)
    chromosome = uniform_chromosome(evaluator.structure)
    fit, partitions = evaluator.fit(chromosome), decode(evaluator.structure, chromosome.astype(float))
    ranges = evaluator.judge.ranges
    model = InertiaFunctions(evaluator.structure, ranges, partitions, fit.coefficients, fit.rigid_body, NOWHERE)
    draws = bootstrap(evaluator, training, model, fit, VALIDATION, np.random.default_rng(6))
    assert draws.blocks >= 2
    assert all(np.isfinite(getattr(draws, name)).all() for name in ("coefficients", "rigid_body", "best_rigid_body"))
    np.testing.assert_allclose(draws.best_rigid_body, np.tile([0.6, 0.7, 1.2, 0, 0, 0], (DRAWS, 1)), atol=1e-9)
