"""Bands of 95 % hold the truth in 90 to 98 of 100 flights, whether the noise is white or coloured."""

import numpy as np
import pytest

from cpfls_cli.dynamics import InertiaFunctions, newton_euler_torque, rigid_columns
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import uniform_chromosome
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings, ValidationSettings
from cpfls_cli.regressor.regressor import Motion, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.validation.bands import BlockScores, band, bootstrap, inertia_band
from tests.builders.flights import coloured_noise

RUNS, SAMPLES, BLOCKS, DRAWS = 200, 2000, 40, 200
INERTIA = np.array([0.6, 0.7, 1.2, 0.03, -0.02, 0.04])
TENSOR = np.array([[0.6, 0.03, -0.02], [0.03, 0.7, 0.04], [-0.02, 0.04, 1.2]])
FIRST_ORDER = {"harmonic_order": 1, "products": "additive"}
WITHIN = (0.90, 0.98)


def turning(samples=SAMPLES):
    """Turn smoothly through complete circles, as a vehicle does: neighbouring samples are alike."""
    time = 0.01 * np.arange(samples)[:, None]
    w, amplitude = np.array([[1.3, 0.9, 0.7], [2.1, 3.1, 2.6]]), np.array([[2.0, 1.7, 1.5], [1.1, 1.4, 0.9]])
    attitude, rate, acceleration = (
        sum(
            a * f**k * np.sin(f * time + 0.5 * k * np.pi + shift)
            for a, f, shift in zip(amplitude, w, (0, 1), strict=True)
        )
        for k in range(3)
    )
    return Motion(attitude, rate, acceleration)


def columns(which):
    """Columns of the torque, and what they multiply in quantities that bands are asked for."""
    m = turning()
    if which == "rigid body":
        return rigid_columns(m), np.eye(6)
    structure = model_structure(IdentificationSettings(**FIRST_ORDER))
    regressor, partitions = Regressor(structure, m, data_ranges(structure, m.attitude)), uniform_breakpoints(structure)
    asked = []
    for index, block in enumerate(structure.blocks):
        rows = np.zeros((20, structure.parameters))
        rows[:, block.columns] = regressor.basis(index, partitions).value[::100]
        asked.append(rows)
    return regressor.matrix(partitions), np.concatenate(asked)


@pytest.mark.parametrize("time_constant", [0, 5], ids=["white", "coloured"])
@pytest.mark.parametrize("which", ["rigid body", "inertia matrix"])
def test_coverage(which, time_constant):
    A, asked = columns(which)
    rng, label = np.random.default_rng(8), np.arange(SAMPLES) * BLOCKS // SAMPLES
    by_block = [A[label == block].reshape(-1, A.shape[2]) for block in range(BLOCKS)]
    gram = np.array([rows.T @ rows for rows in by_block])
    truth, inside = rng.standard_normal(A.shape[2]), []
    for _ in range(RUNS):
        torque = A @ truth + 0.1 * coloured_noise(rng, SAMPLES, time_constant)
        x = np.linalg.solve(gram.sum(axis=0), np.einsum("nap,na->p", A, torque))
        residual = torque - A @ x
        score = [rows.T @ residual[label == block].ravel() for block, rows in enumerate(by_block)]
        drawn = BlockScores(gram, np.array(score), np.zeros(len(x)), x).draws(
            rng.standard_normal((DRAWS, BLOCKS)), 1e-10
        )
        low, high = band(asked @ x, (x + drawn) @ asked.T, BLOCKS)
        inside.append((low <= asked @ truth) & (asked @ truth <= high))
    assert WITHIN[0] <= np.mean(inside) <= WITHIN[1]
    assert np.min(np.mean(inside, axis=0)) > 0.85


@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_the_known_inertia_of_a_vehicle_lies_within_its_bands(base):
    m = turning()
    exact, rng = newton_euler_torque(m.attitude, m.rate, m.acceleration, TENSOR), np.random.default_rng(9)
    exact = exact if base == "rigid-body" else newton_euler_torque(*vars(m).values(), np.diag([0.6, 0.7, 1.2]))
    truth = INERTIA if base == "rigid-body" else np.array([0.6, 0.7, 1.2, 0, 0, 0])
    training = TorqueData(
        0.01 * np.arange(SAMPLES), m, exact + 0.1 * exact.std(axis=0) * coloured_noise(rng, SAMPLES, 5)
    )
    evaluator = model_evaluator(training, training, IdentificationSettings(base=base))
    fit, partitions = evaluator.fit(uniform_chromosome(evaluator.structure)), uniform_breakpoints(evaluator.structure)
    model = InertiaFunctions(
        evaluator.structure,
        evaluator.judge.ranges,
        partitions,
        fit.coefficients,
        fit.rigid_body,
        np.ones((72, 72), dtype=bool),
    )
    draws = bootstrap(evaluator, training, model, fit, ValidationSettings(), rng)
    low, high = band(np.mean(draws.best_rigid_body, axis=0), draws.best_rigid_body, draws.blocks)
    assert np.sum((low <= truth) & (truth <= high)) >= 5
    assert np.all(high - low < 0.1)
    low, high = inertia_band(model, draws, m.attitude)
    W = np.eye(3)[None].repeat(SAMPLES, axis=0)
    roll, pitch = m.attitude[:, 0], m.attitude[:, 1]
    W[:, 0, 2], W[:, 1, 1], W[:, 1, 2] = -np.sin(pitch), np.cos(roll), np.sin(roll) * np.cos(pitch)
    W[:, 2, 1], W[:, 2, 2] = -np.sin(roll), np.cos(roll) * np.cos(pitch)
    tensor = TENSOR if base == "rigid-body" else np.diag([0.6, 0.7, 1.2])
    true = W.swapaxes(1, 2) @ tensor @ W
    assert np.mean((low - 1e-12 <= true) & (true <= high + 1e-12)) > 0.8
