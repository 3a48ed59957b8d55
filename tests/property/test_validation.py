"""Bands and passivity of any model."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from cpfls_cli.dynamics import InertiaFunctions, coriolis_matrix
from cpfls_cli.fuzzy.basis import InputRange
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import decode
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings, ValidationSettings
from cpfls_cli.regressor.regressor import Motion, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.validation import bands
from cpfls_cli.validation.bands import band, bootstrap, inertia_band, torque_band
from tests.builders.flights import random_motion

SAMPLES = 240
STRUCTURES = [
    {"consequents": "seesaw", "products": "additive", "membership_functions": 3, "input_map": "data-range"},
    {"consequents": "seesaw", "products": "tensor", "membership_functions": (1, 2, 3, 4, 3, 2)},
    {"consequents": "seesaw", "structure": "fls", "membership_functions": 2, "products": "additive"},
    {"harmonic_order": 1},
]


def case(keys, base, seed, noise):
    """Fit a random model of a structure to its own torque and noise."""
    rng = np.random.default_rng(seed)
    chosen, m = IdentificationSettings(**keys, base=base), random_motion(rng, SAMPLES)
    shape = model_evaluator(data := TorqueData(0.01 * np.arange(SAMPLES), m, np.ones((SAMPLES, 3))), data, chosen)
    partitions = decode(shape.structure, rng.uniform(0.2, 1.0, shape.structure.genes))
    truth = InertiaFunctions(
        shape.structure,
        shape.judge.ranges,
        partitions,
        rng.standard_normal(shape.structure.parameters),
        np.zeros(6),
        np.zeros((72, 72), dtype=bool),
    )
    training = replace(data, torque=truth.torque(m) + noise * rng.standard_normal((SAMPLES, 3)))
    evaluator = model_evaluator(training, training, chosen)
    fit = evaluator.solver.fit(partitions)
    model = replace(truth, coefficients=fit.coefficients, rigid_body=fit.rigid_body)
    drawn = bootstrap(evaluator, training, model, fit, ValidationSettings(draws=40), np.random.default_rng(seed))
    return model, drawn, m


@settings(max_examples=10, deadline=None)
@given(keys=st.sampled_from(STRUCTURES), base=st.sampled_from(["none", "rigid-body"]), seed=st.integers(0, 100))
def test_a_band_holds_the_model_and_is_the_spread_of_models(keys, base, seed):
    """Each draw as a model of its own: its inertia and its torque, evaluated one after the other."""
    model, draws, m = case(keys, base, seed, noise=0.1)
    some = m[slice(0, 20)]
    models = [
        replace(model, coefficients=coefficients, rigid_body=rigid_body)
        for coefficients, rigid_body in zip(draws.coefficients, draws.rigid_body, strict=True)
    ]
    quantile = stats.t.ppf(0.975, draws.blocks - 1)
    for (low, high), value, drawn in (
        (
            inertia_band(model, draws, some.attitude),
            model.inertia(some.attitude).value,
            [other.inertia(some.attitude).value for other in models],
        ),
        (torque_band(model, draws, some), model.torque(some), [other.torque(some) for other in models]),
    ):
        assert low.shape == high.shape == value.shape
        assert np.all(low <= value)
        assert np.all(value <= high)
        half = quantile * np.sqrt(np.mean((np.array(drawn) - value) ** 2, axis=0))
        np.testing.assert_allclose(high - value, half, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(value - low, half, rtol=1e-6, atol=1e-9)


def test_batches_change_nothing(monkeypatch):
    model, draws, m = case(STRUCTURES[0], "rigid-body", 1, noise=0.1)
    whole = *inertia_band(model, draws, m.attitude), *torque_band(model, draws, m)
    monkeypatch.setattr(bands, "_BATCH", 7)
    parts = *inertia_band(model, draws, m.attitude), *torque_band(model, draws, m)
    for one, other in zip(whole, parts, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("blocks", "quantile"), [(1, 12.706), (2, 12.706), (10, 2.262), (10**6, 1.960)])
def test_few_blocks_widen_a_band(blocks, quantile):
    low, high = band(np.array([1.0]), np.array([[0.0], [2.0]]), blocks)
    assert (low[0], high[0]) == pytest.approx((1 - quantile, 1 + quantile), abs=2e-3)


SEESAW = {"consequents": "seesaw", "products": "additive", "membership_functions": 5}
NAMED_STRUCTURES = {
    "paper, full circle": SEESAW,
    "paper, data range": {**SEESAW, "input_map": "data-range"},
    "classic": {**SEESAW, "structure": "fls"},
    "classic, data range": {**SEESAW, "structure": "fls", "input_map": "data-range"},
    "harmonic, additive": {"harmonic_order": 1, "products": "additive", "membership_functions": 3},
    "harmonic, tensor": {"harmonic_order": 2, "products": "tensor", "membership_functions": 1},
}
STEP = 1e-6


def drawn(structure, seed):
    """A model with random coefficients over a random rigid body."""
    rng = np.random.default_rng(seed)
    counted = model_structure(StructureSettings(**NAMED_STRUCTURES[structure]))
    ranges = (InputRange(-0.9, 0.8), InputRange(-0.7, 0.9))
    coefficients, rigid_body = rng.standard_normal(counted.parameters), rng.standard_normal(6)
    visited = rng.random((72, 72)) < 0.05
    return InertiaFunctions(counted, ranges, uniform_breakpoints(counted), coefficients, rigid_body, visited), rng


def attitudes(rng, samples=40):
    """Away from quarter turns, where the triangle wave has its corners and the classic system its seam."""
    return rng.integers(-4, 4, (samples, 3)) * (np.pi / 2) + rng.uniform(0.01, np.pi / 2 - 0.01, (samples, 3))


any_model = pytest.mark.parametrize("structure", NAMED_STRUCTURES)
any_seed = given(st.integers(0, 2**32 - 1))
few = settings(deadline=None, max_examples=10)


@any_model
@few
@any_seed
def test_no_energy_is_made(structure, seed):
    model, rng = drawn(structure, seed)
    q, qd = attitudes(rng), rng.standard_normal((40, 3))
    C = coriolis_matrix(model.inertia(q), qd)
    ahead, behind = (model.inertia(q + sign * STEP * qd).value for sign in (1, -1))
    skew = (ahead - behind) / (2 * STEP) - 2 * C
    np.testing.assert_allclose(skew, -skew.swapaxes(1, 2), atol=1e-4 * np.max(np.abs(C)))


@any_model
@few
@any_seed
def test_torque_is_inertia_times_acceleration_and_coriolis_times_rate(structure, seed):
    model, rng = drawn(structure, seed)
    motion = Motion(attitudes(rng), *rng.standard_normal((2, 40, 3)))
    inertial = np.einsum("nij,nj->ni", model.inertia(motion.attitude).value, motion.acceleration)
    turning = np.einsum("nij,nj->ni", coriolis_matrix(model.inertia(motion.attitude), motion.rate), motion.rate)
    torque = model.torque(motion)
    np.testing.assert_allclose(torque, inertial + turning, atol=1e-12 * np.max(np.abs(torque)))
