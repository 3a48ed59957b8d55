"""A model simulated and identified again comes back: exactly without noise, within its bands with it."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.dynamics import InertiaFunctions, visited_cells
from cpfls_cli.identification import data
from cpfls_cli.identification.evaluator import uniform_chromosome
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.judge import fit_baselines
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.regressor import uniform_breakpoints
from cpfls_cli.validation.bands import bootstrap, missed_torque
from cpfls_cli.validation.residuals import time_blocks
from cpfls_cli.validation.validate import curves, round_trip, simulated_torque
from tests.builders.flights import bent_torque, random_flight

SAMPLES = 800


def bending_flight(noise):
    return random_flight(bent_torque(size=0.5), 113, SAMPLES, noise=noise)


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


def test_it_tells_where_it_leaves_the_bands():
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
    assert len(source) == SAMPLES
