"""Samples in memory and in chunks."""

import pickle
from dataclasses import replace
from types import SimpleNamespace

import numba
import numpy as np
import pytest

from cpfls_cli.compiling import compiled
from cpfls_cli.dynamics import rigid_columns
from cpfls_cli.identification import data, samples, solver
from cpfls_cli.identification.data import Flights, TorqueData, gathered, joined, sample_times
from cpfls_cli.identification.evaluator import decode
from cpfls_cli.identification.findings import axis_evidence, score_of
from cpfls_cli.identification.identify import identify, model_evaluator
from cpfls_cli.identification.samples import Ready, Samples
from cpfls_cli.identification.settings import IdentificationSettings, LocalSearchSettings, RidgeSettings
from cpfls_cli.identification.solver import contiguous_blocks, with_folds
from cpfls_cli.regressor import kernels
from cpfls_cli.regressor.regressor import RIGID, Motion, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from tests.builders.flights import random_flight, rigid_torque

SETTINGS = IdentificationSettings(consequents="seesaw", products="additive", membership_functions=(1, 2, 3, 4, 3, 2))
STRUCTURE = model_structure(SETTINGS)
SAMPLES = 150
LABELS = 3
SCALE = np.array([2.0, 1.0, 0.25])


def flight_of_noise(samples=SAMPLES):
    return random_flight(lambda motion: np.zeros((len(motion), 3)), 46, samples, noise=1.0)


SEESAW = {"consequents": "seesaw", "products": "additive"}
UNEQUAL = (1, 2, 3, 4, 5, 2)
STRUCTURES = {
    "paper-data-range": {**SEESAW, "membership_functions": 5, "input_map": "data-range"},
    "paper": {**SEESAW, "membership_functions": 5},
    "classic": {**SEESAW, "membership_functions": 5, "structure": "fls"},
    "classic-data-range": {**SEESAW, "membership_functions": 4, "structure": "fls", "input_map": "data-range"},
    "classic-tensor": {**SEESAW, "products": "tensor", "membership_functions": UNEQUAL, "structure": "fls"},
    "unequal": {**SEESAW, "membership_functions": UNEQUAL},
    "most": {**SEESAW, "membership_functions": 15},
    "harmonic-tensor": {"products": "tensor", "membership_functions": UNEQUAL},
    "harmonic-additive": {"products": "additive", "membership_functions": 4, "harmonic_order": 3},
    "harmonic-alone": {"products": "tensor", "membership_functions": 1},
}
ZERO_WIDTH = ("paper-data-range", "classic", "classic-data-range", "unequal", "harmonic-tensor")
CASES = [(name, False) for name in STRUCTURES] + [(name, True) for name in ZERO_WIDTH]


@pytest.fixture(params=CASES, ids=lambda case: case[0] + ("-zero-width" if case[1] else ""))
def case(request, monkeypatch):
    """Samples in several chunks on both sides of their training range, and the rows that they stand for.

    Every other structure stands over a rigid body, and has its labels in no order.
    """
    monkeypatch.setattr(data, "CHUNK", 64)
    (name, zero_width), rng = request.param, np.random.default_rng(47)
    rigid = list(STRUCTURES).index(name) % 2 == 1
    structure = model_structure(StructureSettings(**STRUCTURES[name]))
    motion = Motion(rng.uniform(-3.5, 3.5, (SAMPLES, 3)), *rng.standard_normal((2, SAMPLES, 3)))
    source = TorqueData(0.01 * np.arange(SAMPLES), motion, rng.standard_normal((SAMPLES, 3)))
    training = 0.2 * motion.attitude if structure.settings.input_map == "data-range" else motion.attitude
    ranges, label = data_ranges(structure, training), rng.integers(0, LABELS, SAMPLES)
    label = label if rigid else np.sort(label)
    weights = rng.uniform(0.2, 1.0, structure.genes)
    if zero_width:
        for part in structure.weight_slices():
            weights[part][::2] = 0.0 if len(weights[part]) > 1 else 1.0
    partitions = decode(structure, weights)
    assert zero_width == any(np.any(np.diff(part) == 0) for part in partitions)
    samples = replace(Samples.of(Ready(source, rigid), structure, ranges), scale=SCALE, label=label, labels=LABELS)
    columns = [rigid_columns(motion)] if rigid else []
    A = np.concatenate([*columns, Regressor(structure, motion, ranges).matrix(partitions)], axis=2) * SCALE[:, None]
    parameters = rng.standard_normal(A.shape[2])
    return SimpleNamespace(
        samples=samples,
        partitions=partitions,
        label=label,
        rows=A,
        torque=source.torque * SCALE,
        parameters=parameters,
        coefficients=parameters[-structure.parameters :],
        rigid_body=parameters[:RIGID] if rigid else np.zeros(RIGID),
        rng=rng,
    )


def assert_close(actual, expected):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-12 * np.abs(expected).max(initial=1.0))


def test_products(case):
    found = case.samples.products(case.partitions)
    for own in range(LABELS):
        A, y = case.rows[case.label == own].reshape(-1, case.rows.shape[2]), case.torque[case.label == own].ravel()
        assert_close(found.gram[own], A.T @ A)
        assert_close(found.moment[own], A.T @ y)
        assert (found.square[own], found.rows[own]) == (pytest.approx(y @ y), len(y))
    some = found.sum(np.array([True, False, True]))
    assert_close(some.gram[0], found.gram[0] + found.gram[2])
    assert some.rows.tolist() == [3 * np.sum(case.label != 1)]


def test_errors(case):
    square, largest = case.samples.errors(case.partitions, case.coefficients, case.rigid_body)
    residual = case.torque - case.rows @ case.parameters
    assert_close(square, np.array([np.sum(residual[case.label == own] ** 2) for own in range(LABELS)]))
    assert_close(largest, np.array([np.abs(residual[case.label == own]).max() for own in range(LABELS)]))


@pytest.mark.parametrize("count", [0, 3, 4])
def test_projected(case, count):
    directions = case.rng.standard_normal((len(case.parameters), count))
    square, back = case.samples.projected(case.partitions, case.parameters, directions)
    A, y = case.rows.reshape(-1, len(case.parameters)), case.torque.ravel()
    assert_close(square, (A @ directions).T @ (A @ directions))
    assert_close(back, A.T @ (y - A @ case.parameters))


def test_neighbours_that_fire_other_rules_are_distinguished():
    """Pairs of samples whose intervals of roll and pitch differ by +1 and by -1 to -13, of 14."""
    structure = model_structure(StructureSettings(**SEESAW, membership_functions=(1, 15, 1, 15, 1, 1)))
    interval = np.array([place for down in range(1, 14) for place in ((0, down, 0), (1, 0, 0))])
    motion = Motion(2 * np.pi * (interval + 0.4) / 14, *np.random.default_rng(49).standard_normal((2, 26, 3)))
    ranges, partitions = data_ranges(structure, motion.attitude), uniform_breakpoints(structure)
    flight = TorqueData(np.arange(26.0), motion, np.zeros((26, 3)))
    found = Samples.of(Ready(flight, rigid=False), structure, ranges).products(partitions)
    Q = Regressor(structure, motion, ranges).matrix(partitions).reshape(78, -1)
    assert_close(found.gram[0], Q.T @ Q)


@pytest.mark.parametrize("rigid", [False, True])
def test_the_loops_are_compiled_for_one_layout_of_arrays(rigid, monkeypatch):
    """Compiling them takes ten seconds, for each layout anew."""
    layouts, partitions = set(), uniform_breakpoints(STRUCTURE)
    monkeypatch.setattr(kernels, "_add_up", lambda *arguments: layouts.add(numba.typeof(arguments)))
    for attitude in (np.zeros((1, 3)), np.zeros((20, 3)), np.zeros((3, 20)).T):
        zeros = np.zeros_like(attitude)
        flight = TorqueData(np.arange(float(len(zeros))), Motion(attitude, zeros, zeros), zeros)
        samples = Samples.of(Ready(flight, rigid), STRUCTURE, data_ranges(STRUCTURE, attitude))
        columns, coefficients = STRUCTURE.parameters + RIGID * rigid, np.zeros(STRUCTURE.parameters)
        samples.products(partitions)
        samples.errors(partitions, coefficients, np.zeros(RIGID))
        samples.moved(partitions, coefficients, np.zeros(RIGID))
        for directions in (np.zeros((columns, 3)), np.zeros((3, columns)).T):
            samples.projected(partitions, np.zeros(columns), directions)
    assert len(layouts) == 1


def test_where_nothing_can_be_kept_a_loop_is_compiled_each_time():
    """A function without a file has no folder for its compiled code: the same error as folders that are read-only."""
    space = {}
    exec("def twice(x):\n    return 2 * x", space)
    assert compiled(space["twice"])(21) == 42


@pytest.mark.parametrize("every", [1, 2])
@pytest.mark.parametrize("folds", [2, 5, 20])
def test_labels_tell_the_folds_that_samples_are_left_out_of(every, folds):
    judged = flight_of_noise(600)
    learned, settings = judged[::every], RidgeSettings(folds=folds, embargo_s=0.25)
    ranges = data_ranges(STRUCTURE, judged.motion.attitude)
    labelled, choice = with_folds(
        *(Samples.of(Ready(source, rigid=True), STRUCTURE, ranges) for source in (learned, judged)), settings
    )
    blocks = contiguous_blocks(judged.time, learned.time, folds, 0.25)
    np.testing.assert_array_equal(choice.left_out[:, labelled.label], blocks.left_out)
    np.testing.assert_array_equal(choice.judged.label == np.arange(folds)[:, None], blocks.validation)
    assert labelled.labels == labelled.label.max() + 1 == choice.left_out.shape[1]
    assert choice.judged.labels == folds


@pytest.mark.parametrize("every", [1, 2])
def test_ridge_curve_is_that_of_refits_to_the_rows(every):
    """The whole way from samples to the curve, against a refit of dense rows for each block and weight."""
    judged = flight_of_noise()
    learned = judged[::every]
    evaluator = model_evaluator(judged, learned, SETTINGS)
    partitions = decode(STRUCTURE, np.random.default_rng(48).uniform(0.2, 1.0, STRUCTURE.genes))
    curve, fit = evaluator.solver.curve(partitions), evaluator.solver.fit(partitions)
    scale = 1 / np.sqrt(np.mean(learned.torque**2, axis=0))
    ranges = data_ranges(STRUCTURE, judged.motion.attitude)

    def rows(source):
        Q = Regressor(STRUCTURE, source.motion, ranges).matrix(partitions)
        return np.concatenate([rigid_columns(source.motion), Q], axis=2) * scale[:, None], source.torque * scale

    (A, y), (B, z) = rows(learned), rows(judged)
    size = np.sqrt(np.mean(A[:, :, RIGID:] ** 2, axis=(0, 1)))
    blocks = contiguous_blocks(judged.time, learned.time, SETTINGS.ridge.folds, SETTINGS.ridge.embargo_s)
    for tried in (0, 8, 16):
        errors = []
        for validation, left_out in zip(blocks.validation, blocks.left_out, strict=True):
            kept, right_side = A[~left_out].reshape(-1, A.shape[2]), y[~left_out].ravel()
            ridge = np.diag(np.append(np.zeros(RIGID), np.sqrt(curve.weight[tried] * len(right_side)) * size))
            stacked = np.vstack([kept, ridge]), np.append(right_side, np.zeros(len(ridge)))
            errors.append((z[validation] - B[validation] @ np.linalg.lstsq(*stacked, rcond=None)[0]) ** 2)
        assert curve.error[tried] == pytest.approx(np.mean(np.concatenate(errors)), rel=1e-6)
    np.testing.assert_allclose(fit.column_size, size, rtol=1e-12)
    np.testing.assert_allclose(fit.row_scale, scale, rtol=1e-12)
    assert fit.mean_squared_error == curve.error[curve.chosen]
    assert fit.ridge_weight == curve.weight[curve.chosen]


def test_workers_are_sent_the_same_whether_or_not_samples_were_made_ready():
    """What is kept for the compiled loops is made again where it is used."""
    ready = Ready(flight_of_noise(), rigid=True)
    before = pickle.dumps(ready)
    kept = list(ready)
    assert pickle.dumps(ready) == before
    (again,) = pickle.loads(before)
    np.testing.assert_array_equal(again[1], kept[0][1])
    samples = Samples.of(ready, STRUCTURE, data_ranges(STRUCTURE, flight_of_noise().motion.attitude))
    before, partitions = pickle.dumps(samples), uniform_breakpoints(STRUCTURE)
    square = samples.products(partitions).square
    assert (pickle.dumps(samples), pickle.loads(before).products(partitions).square) == (before, square)


STREAMED = {
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
    return model_evaluator(source, source, IdentificationSettings(**{**STREAMED, "base": base, **changed}))


def evaluated(source, base):
    """Objectives of some chromosomes, unrefined."""
    evaluate = evaluator(source, base, local_search=LocalSearchSettings(enabled=False))
    return evaluate(np.random.default_rng(41).integers(1, 65536, (6, evaluate.structure.genes))).objectives


def identified(source, base, held_out):
    settings = IdentificationSettings(**{**STREAMED, "base": base})
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
    np.testing.assert_allclose(unpenalised.singular_values, np.linalg.svd(divided, compute_uv=False), rtol=1e-9)


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
