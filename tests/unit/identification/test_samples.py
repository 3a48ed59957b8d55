"""Sums over samples against the rows written out: with and without a rigid body, scaled by axis, by label."""

import pickle
from dataclasses import replace
from types import SimpleNamespace

import numba
import numpy as np
import pytest

from cpfls_cli.dynamics.rigid_body import rigid_columns
from cpfls_cli.identification import data
from cpfls_cli.identification.cross_validation import contiguous_blocks, with_folds
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import decode
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.samples import Ready, Samples
from cpfls_cli.identification.settings import IdentificationSettings, RidgeSettings
from cpfls_cli.regressor import kernels
from cpfls_cli.regressor.motion import RIGID, Motion
from cpfls_cli.regressor.regressor import Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import model_structure
from tests.builders.flights import no_torque, random_flight
from tests.builders.torque_sensitivity import torque_sensitivity

SETTINGS = IdentificationSettings(consequents="seesaw", products="additive", membership_functions=(1, 2, 3, 4, 3, 2))
STRUCTURE = model_structure(SETTINGS)
SAMPLES = 150
LABELS = 3
SCALE = np.array([2.0, 1.0, 0.25])


def flight_of_noise(samples=SAMPLES):
    return random_flight(no_torque, 46, samples, noise=1.0)


@pytest.fixture(params=[False, True], ids=["none", "rigid-body"])
def case(request, monkeypatch):
    """Samples in several chunks, and the rows that they stand for."""
    monkeypatch.setattr(data, "CHUNK", 64)
    source, rng = flight_of_noise(), np.random.default_rng(47)
    motion = source.motion
    ranges = data_ranges(STRUCTURE, motion.attitude)
    label = rng.integers(0, LABELS, SAMPLES)
    samples = replace(
        Samples.of(Ready(source, request.param), STRUCTURE, ranges), scale=SCALE, label=label, labels=LABELS
    )
    partitions = decode(STRUCTURE, rng.uniform(0.2, 1.0, STRUCTURE.genes))
    regressor = Regressor(STRUCTURE, motion, ranges)
    columns = [rigid_columns(motion)] if request.param else []
    A = np.concatenate([*columns, regressor.matrix(partitions)], axis=2) * SCALE[:, None]
    parameters = rng.standard_normal(A.shape[2])
    rigid = A.shape[2] - STRUCTURE.parameters
    return SimpleNamespace(
        samples=samples,
        partitions=partitions,
        regressor=regressor,
        label=label,
        rows=A,
        torque=source.torque * SCALE,
        parameters=parameters,
        coefficients=parameters[rigid:],
        rigid_body=parameters[:RIGID] if rigid else np.zeros(RIGID),
        rng=rng,
    )


def assert_close(actual, expected):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_products(case):
    found = case.samples.products(case.partitions)
    for own in range(LABELS):
        A, y = case.rows[case.label == own].reshape(-1, case.rows.shape[2]), case.torque[case.label == own].ravel()
        assert_close(found.gram[own], A.T @ A)
        assert_close(found.moment[own], A.T @ y)
        assert found.square[own] == pytest.approx(y @ y)
        assert found.rows[own] == len(y)
    some = found.sum(np.array([True, False, True]))
    assert_close(some.gram[0], found.gram[0] + found.gram[2])
    assert some.rows.tolist() == [3 * np.sum(case.label != 1)]


def test_errors(case):
    square, largest = case.samples.errors(case.partitions, case.coefficients, case.rigid_body)
    residual = case.torque - case.rows @ case.parameters
    assert_close(square, np.array([np.sum(residual[case.label == own] ** 2) for own in range(LABELS)]))
    assert_close(largest, np.array([np.abs(residual[case.label == own]).max() for own in range(LABELS)]))


def test_projected(case):
    directions = case.rng.standard_normal((len(case.parameters), 3))
    square, back = case.samples.projected(case.partitions, case.parameters, directions)
    A, y = case.rows.reshape(-1, len(case.parameters)), case.torque.ravel()
    assert_close(square, (A @ directions).T @ (A @ directions))
    assert_close(back, A.T @ (y - A @ case.parameters))


def test_moved(case):
    found = case.samples.moved(case.partitions, case.coefficients, case.rigid_body)
    moved = np.concatenate(torque_sensitivity(case.regressor, case.partitions, case.coefficients), axis=2)
    M = (moved * SCALE[:, None]).reshape(case.torque.size, -1)
    A = case.rows.reshape(-1, len(case.parameters))
    residual = case.torque.ravel() - A @ case.parameters
    assert_close(found.columns, A.T @ M)
    assert_close(found.moved, M.T @ M)
    assert_close(found.residual, M.T @ residual)
    assert found.square == pytest.approx(residual @ residual)


def test_the_loops_are_compiled_for_one_layout_of_arrays(case, monkeypatch):
    """Compiling them takes ten seconds, for each layout anew."""
    layouts = set()
    monkeypatch.setattr(kernels, "_add_up", lambda *arguments: layouts.add(numba.typeof(arguments)))
    for attitude in (np.zeros((1, 3)), np.zeros((20, 3)), np.zeros((3, 20)).T):
        zeros = np.zeros_like(attitude)
        flight = TorqueData(np.arange(float(len(zeros))), Motion(attitude, zeros, zeros), zeros)
        samples = Samples.of(Ready(flight, case.samples.ready.rigid), STRUCTURE, case.samples.ranges)
        samples.products(case.partitions)
        samples.errors(case.partitions, case.coefficients, case.rigid_body)
        samples.moved(case.partitions, case.coefficients, case.rigid_body)
        for directions in (np.zeros((len(case.parameters), 3)), np.zeros((3, len(case.parameters))).T):
            samples.projected(case.partitions, case.parameters, directions)
    assert len(layouts) == 1


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
    attitude = flight_of_noise().motion.attitude
    samples = Samples.of(ready, STRUCTURE, data_ranges(STRUCTURE, attitude))
    before, partitions = pickle.dumps(samples), uniform_breakpoints(STRUCTURE)
    square = samples.products(partitions).square
    assert pickle.dumps(samples) == before
    assert pickle.loads(before).products(partitions).square == square
