"""What is computed does not depend on how the samples come: at once, in chunks, from one flight or from several."""

import numpy as np
import pytest

from cpfls_cli.dynamics import rigid_columns
from cpfls_cli.identification import data, samples, solver
from cpfls_cli.identification.data import Flights, TorqueData, gathered, joined, sample_times
from cpfls_cli.identification.evaluator import decode
from cpfls_cli.identification.findings import axis_evidence
from cpfls_cli.identification.identify import identify, model_evaluator
from cpfls_cli.identification.judge import score_of
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings
from cpfls_cli.regressor.regressor import Motion, Regressor, data_ranges
from tests.builders.flights import random_flight, rigid_torque

SETTINGS = {
    "consequents": "seesaw",
    "products": "additive",
    "input_map": "data-range",
    "membership_functions": 3,
    "population": 10,
    "generations": 2,
    "local_search": LocalSearchSettings(evaluations=2),
}
BASES = ("none", "rigid-body")
CHUNKS = (1000, 64, 37, 1)


def torque_of_no_body(motion):
    """Torque of an inertia that no rigid body has."""
    torque = rigid_torque()(motion)
    torque[:, 1] += 0.5 * np.exp(motion.attitude[:, 0]) * motion.acceleration[:, 1]
    return torque


def streamed_flight(samples=150, seed=40, start=0.0):
    return random_flight(torque_of_no_body, seed, samples, noise=0.02, limit=1.0, start=start)


def concatenated(flights):
    """The flights as one, with the times that they have one after the other."""
    motion = [
        np.concatenate([getattr(f.motion, name) for f in flights]) for name in ("attitude", "rate", "acceleration")
    ]
    return TorqueData(sample_times(Flights(flights)), Motion(*motion), np.concatenate([f.torque for f in flights]))


def evaluator(source, base, **changed):
    return model_evaluator(source, source, IdentificationSettings(**{**SETTINGS, "base": base, **changed}))


def evaluated(source, base):
    """Objectives of some chromosomes, unrefined."""
    evaluate = evaluator(source, base, local_search=LocalSearchSettings(enabled=False))
    genes = np.random.default_rng(41).integers(1, 65536, (6, evaluate.structure.genes))
    return evaluate(genes).objectives


def identified(source, base, held_out):
    settings = IdentificationSettings(**{**SETTINGS, "base": base})
    return identify(source, source, {"other": held_out}, settings, np.random.default_rng(1))


def assert_same_model(one, other):
    np.testing.assert_array_equal(one.front.chromosomes, other.front.chromosomes)
    np.testing.assert_allclose(one.front.objectives, other.front.objectives, rtol=1e-9)
    np.testing.assert_allclose(one.model.coefficients, other.model.coefficients, atol=1e-9)
    np.testing.assert_allclose(one.model.rigid_body, other.model.rigid_body, atol=1e-9)
    np.testing.assert_array_equal(one.model.visited, other.model.visited)
    assert one.findings == other.findings
    for part, scores in one.scores.items():
        for name, expected in scores.items():
            for key, values in vars(expected).items():
                np.testing.assert_allclose(getattr(other.scores[part][name], key), values, rtol=1e-9, atol=1e-12)


def test_flights_come_one_after_the_other():
    flights = streamed_flight(70), streamed_flight(50, 42, start=5.0), streamed_flight(30, 43)
    time = sample_times(joined(flights))
    assert len(joined(flights)) == 150
    assert np.all(np.diff(time) > 0)
    np.testing.assert_allclose(time[:70], flights[0].time)
    np.testing.assert_allclose(np.diff(time[70:120]), 0.01)
    assert min(time[70] - time[69], time[120] - time[119]) > 100
    assert joined(flights[:1]) is flights[0]


@pytest.mark.parametrize("chunk", CHUNKS)
def test_gathered_samples_are_those_of_the_whole(monkeypatch, chunk):
    flights = streamed_flight(70), streamed_flight(50, 42), streamed_flight(30, 43)
    monkeypatch.setattr(data, "CHUNK", chunk)
    whole, chosen = concatenated(flights), np.array([0, 3, 69, 70, 71, 119, 120, 149])
    found = gathered(joined(flights), chosen)
    np.testing.assert_array_equal(found.time, whole.time[chosen])
    np.testing.assert_array_equal(found.torque, whole.torque[chosen])
    for name, values in vars(whole.motion).items():
        np.testing.assert_array_equal(getattr(found.motion, name), values[chosen])


@pytest.mark.parametrize("base", BASES)
def test_several_flights_give_the_model_of_their_concatenation(base):
    flights = streamed_flight(), streamed_flight(90, 42, start=3.0)
    assert_same_model(
        *(identified(source, base, streamed_flight(50, 44)) for source in (concatenated(flights), joined(flights)))
    )


@pytest.mark.parametrize("base", BASES)
def test_samples_too_many_to_keep_give_the_very_same(monkeypatch, base):
    monkeypatch.setattr(data, "CHUNK", 64)
    kept = evaluated(streamed_flight(), base)
    monkeypatch.setattr(samples, "_KEPT", 0)
    np.testing.assert_array_equal(evaluated(streamed_flight(), base), kept)


def test_score_of_torque_far_from_zero_keeps_its_digits(monkeypatch):
    """Where the mean dwarfs the variance, sums of squares alone would leave nothing of it."""
    moved = streamed_flight()
    moved = TorqueData(moved.time, moved.motion, moved.torque + 1e7)
    monkeypatch.setattr(data, "CHUNK", 37)
    found = score_of(moved, lambda motion: np.full_like(motion.attitude, 1e7))
    error = moved.torque - 1e7
    expected = 1 - np.sum(error**2, axis=0) / np.sum((moved.torque - np.mean(moved.torque, axis=0)) ** 2, axis=0)
    np.testing.assert_allclose(found.r2, expected, atol=1e-7)


def written_out(evaluate, partitions, fit):
    """Rows, ridge and right-hand side of a fit, all at once; also its number of rigid-body columns."""
    source, rigid = evaluate.judge.ready.source, 6 if evaluate.cross_validated else 0
    fuzzy = Regressor(evaluate.structure, source.motion, data_ranges(evaluate.structure, source.motion.attitude))
    columns = [rigid_columns(source.motion)] if rigid else []
    if np.isfinite(fit.ridge_weight):
        columns.append(fuzzy.matrix(partitions))
    A = (np.concatenate(columns, axis=2) * fit.row_scale[:, None]).reshape(source.torque.size, -1)
    return A, (source.torque * fit.row_scale).ravel(), rigid


@pytest.mark.parametrize("block", [4096, 41, 1])
@pytest.mark.parametrize("case", ["none", "rigid-body", "off"])
def test_final_model_is_that_of_all_rows_at_once(monkeypatch, case, block):
    """The decomposition of blocks against numpy's least squares over the dense rows, the ridge below them."""
    monkeypatch.setattr(solver, "_BLOCK", block)
    source = streamed_flight()
    if case == "off":
        source = TorqueData(
            source.time, source.motion, rigid_columns(source.motion) @ np.array([0.6, 0.7, 1.2, 0, 0, 0])
        )
    evaluate = evaluator(source, "none" if case == "none" else "rigid-body")
    chromosome = np.random.default_rng(45).integers(20000, 65536, evaluate.structure.genes)
    fit, partitions = evaluate.fit(chromosome), decode(evaluate.structure, chromosome.astype(float))
    assert np.isinf(fit.ridge_weight) == (case == "off")
    exact, unpenalised = evaluate.solver.exact(partitions, fit)
    A, y, rigid = written_out(evaluate, partitions, fit)
    held = A.shape[1] - rigid
    weight = np.sqrt(fit.ridge_weight * len(y)) * fit.column_size if held else np.zeros(0)
    ridge = np.hstack([np.zeros((held, rigid)), np.diag(weight)])
    expected = np.linalg.lstsq(np.vstack([A, ridge]), np.append(y, np.zeros(held)), rcond=None)[0]
    np.testing.assert_allclose(exact.rigid_body[:rigid], expected[:rigid], atol=1e-9)
    np.testing.assert_allclose(exact.coefficients, expected[rigid:] if held else 0.0, atol=1e-9)
    np.testing.assert_allclose(exact.coefficients, fit.coefficients, atol=1e-6)
    if case == "none":
        # The others carry what the cross-validation found.
        assert exact.mean_squared_error == pytest.approx(np.mean((y - A @ expected) ** 2), rel=1e-9)
    divided = A / np.append(np.ones(rigid), fit.column_size[:held])
    singular_values = np.linalg.svd(divided, compute_uv=False)
    np.testing.assert_allclose(unpenalised.singular_values, singular_values, rtol=1e-9)


@pytest.mark.parametrize("chunk", CHUNKS)
def test_scores_do_not_depend_on_chunks(monkeypatch, chunk):
    source = streamed_flight()

    def predict(motion):
        return rigid_columns(motion) @ np.array([0.6, 0.9, 1.1, 0.0, 0.05, 0.0])

    whole = score_of(source, predict)
    error = source.torque - predict(source.motion)
    np.testing.assert_allclose(whole.mse, np.mean(error**2, axis=0), rtol=1e-12)
    np.testing.assert_allclose(whole.r2, 1 - np.mean(error**2, axis=0) / np.var(source.torque, axis=0), rtol=1e-12)
    monkeypatch.setattr(data, "CHUNK", chunk)
    for key, values in vars(score_of(source, predict)).items():
        np.testing.assert_allclose(values, getattr(whole, key), rtol=1e-11)


@pytest.mark.parametrize("chunk", CHUNKS)
def test_evidence_on_axes_does_not_depend_on_chunks(monkeypatch, chunk):
    whole = axis_evidence(streamed_flight(), 1e-10)
    monkeypatch.setattr(data, "CHUNK", chunk)
    for key, values in vars(axis_evidence(streamed_flight(), 1e-10)).items():
        np.testing.assert_allclose(values, getattr(whole, key), rtol=1e-9, atol=1e-12)
