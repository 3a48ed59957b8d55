"""Compiled sums over samples against the same sums of the dense regressor and of its closed-form derivatives."""

from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.compiling import compiled
from cpfls_cli.identification.evaluator import decode
from cpfls_cli.regressor import kernels
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.regressor.table import mapped_inputs, padded_breakpoints, structure_table
from tests.builders.torque_sensitivity import torque_sensitivity

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
# Not a multiple of the batch of samples that the loops work on.
SAMPLES = 203
LABELS = 3
DENSE = 4
SCALE = np.array([1.0, 2.0, 0.5])


@pytest.fixture(params=CASES, ids=lambda case: case[0] + ("-zero-width" if case[1] else ""))
def case(request):
    """A model with random partitions and coefficients, and samples on both sides of its training range."""
    name, zero_width = request.param
    structure = model_structure(StructureSettings(**STRUCTURES[name]))
    rng = np.random.default_rng(31)
    attitude = rng.uniform(-3.5, 3.5, (SAMPLES, 3))
    motion = Motion(attitude, *rng.standard_normal((2, SAMPLES, 3)))
    training = 0.2 * attitude if structure.settings.input_map == "data-range" else attitude
    regressor = Regressor(structure, motion, data_ranges(structure, training))
    weights = rng.uniform(0.2, 1.0, structure.genes)
    if zero_width:
        for part in structure.weight_slices():
            weights[part][::2] = 0.0 if len(weights[part]) > 1 else 1.0
    partitions = decode(structure, weights)
    assert zero_width == any(np.any(np.diff(part) == 0) for part in partitions)
    table = structure_table(structure, regressor.ranges)
    dense = rng.standard_normal((SAMPLES, 3, DENSE))
    breakpoints, inputs = padded_breakpoints(partitions), mapped_inputs(table, attitude)
    return SimpleNamespace(
        regressor=regressor,
        partitions=partitions,
        dense=dense * SCALE[:, None],
        Q=regressor.matrix(partitions) * SCALE[:, None],
        arguments=(
            table,
            breakpoints,
            kernels.Chunk(kernels.motion_lines(motion.rate, motion.acceleration, dense), inputs),
            kernels.runs_of(table, breakpoints, inputs),
            SCALE,
        ),
        label=np.sort(rng.integers(0, LABELS, SAMPLES)),
        parameters=structure.parameters,
        breakpoints=table.breakpoints,
        rng=rng,
    )


def flat(rows):
    return rows.reshape(-1, rows.shape[-1])


def mirrored(triangle):
    """Sums whose entries off the diagonal mean those of both sides."""
    total = triangle + triangle.T
    total[np.diag_indices(len(total))] /= 2
    return total


def assert_close(actual, expected):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-12 * np.max(np.abs(expected), initial=1.0))


@pytest.mark.parametrize("shuffled", [False, True])
def test_gram_by_label(case, shuffled):
    label = case.rng.permutation(case.label) if shuffled else case.label
    gram, moment = np.zeros((LABELS, case.parameters, case.parameters)), np.zeros((LABELS, case.parameters, DENSE))
    kernels.add_gram(*case.arguments, label, gram, moment)
    for own in range(LABELS):
        Q, dense = flat(case.Q[label == own]), flat(case.dense[label == own])
        assert_close(mirrored(gram[own]), Q.T @ Q)
        assert_close(moment[own], Q.T @ dense)


def test_sums_are_added_to_what_is_there(case):
    once, twice = (
        (np.zeros((1, case.parameters, case.parameters)), np.zeros((1, case.parameters, DENSE))) for _ in "12"
    )
    label = np.zeros(SAMPLES, dtype=np.int64)
    for _ in range(2):
        kernels.add_gram(*case.arguments, label, *twice)
    kernels.add_gram(*case.arguments, label, *once)
    for single, double in zip(once, twice, strict=True):
        assert_close(double, 2 * single)


def test_errors_by_label(case):
    coefficients, weights = case.rng.standard_normal((2, case.parameters)), case.rng.standard_normal((2, DENSE))
    square, largest = np.zeros((LABELS, 2)), np.zeros((LABELS, 2))
    kernels.add_errors(*case.arguments, case.label, coefficients, weights, square, largest)
    residual = case.dense @ weights.T - case.Q @ coefficients.T
    by_label = [flat(residual[case.label == own]) for own in range(LABELS)]
    assert_close(square, [np.sum(rows**2, axis=0) for rows in by_label])
    assert_close(largest, [np.max(np.abs(rows), axis=0) for rows in by_label])


def test_neighbours_that_fire_other_rules_are_told_apart():
    """Pairs of samples whose intervals of roll and pitch differ by +1 and by -1 to -13, of 14."""
    structure = model_structure(StructureSettings(**SEESAW, membership_functions=(1, 15, 1, 15, 1, 1)))
    interval = np.array([place for down in range(1, 14) for place in ((0, down, 0), (1, 0, 0))])
    motion = Motion(2 * np.pi * (interval + 0.4) / 14, *np.random.default_rng(49).standard_normal((2, 26, 3)))
    regressor = Regressor(structure, motion, data_ranges(structure, motion.attitude))
    partitions = uniform_breakpoints(structure)
    gram, moment = np.zeros((1, structure.parameters, structure.parameters)), np.zeros((1, structure.parameters, 1))
    table = structure_table(structure, regressor.ranges)
    breakpoints, inputs = padded_breakpoints(partitions), mapped_inputs(table, motion.attitude)
    kernels.add_gram(
        table,
        breakpoints,
        kernels.Chunk(kernels.motion_lines(motion.rate, motion.acceleration, np.zeros((26, 3, 1))), inputs),
        kernels.runs_of(table, breakpoints, inputs),
        np.ones(3),
        np.zeros(26, dtype=np.int64),
        gram,
        moment,
    )
    Q = flat(regressor.matrix(partitions))
    assert_close(mirrored(gram[0]), Q.T @ Q)


@pytest.mark.parametrize("models", [1, 4, 5])
def test_products_of_residuals(case, models):
    coefficients = case.rng.standard_normal((models, case.parameters))
    weights = case.rng.standard_normal((models, DENSE))
    square, back, dense_back = np.zeros((models, models)), np.zeros((case.parameters, 1)), np.zeros((DENSE, 1))
    kernels.add_combined(*case.arguments, coefficients, weights, square, back, dense_back)
    residual = flat(case.dense @ weights.T - case.Q @ coefficients.T)
    assert_close(mirrored(square), residual.T @ residual)
    assert_close(back[:, 0], flat(case.Q).T @ residual[:, 0])
    assert_close(dense_back[:, 0], flat(case.dense).T @ residual[:, 0])


def test_products_with_the_derivatives_by_breakpoints(case):
    coefficients, weights = case.rng.standard_normal(case.parameters), case.rng.standard_normal(DENSE)
    columns = case.breakpoints + 1
    cross, dense_cross = np.zeros((case.parameters, columns)), np.zeros((DENSE, columns))
    square = np.zeros((columns, columns))
    kernels.add_moved(*case.arguments, coefficients, weights, cross, dense_cross, square)
    moved = np.concatenate(torque_sensitivity(case.regressor, case.partitions, coefficients), axis=2)
    residual = case.dense @ weights - case.Q @ coefficients
    expected = flat(np.concatenate([moved * SCALE[:, None], residual[:, :, None]], axis=2))
    assert_close(cross, flat(case.Q).T @ expected)
    assert_close(dense_cross, flat(case.dense).T @ expected)
    assert_close(mirrored(square), expected.T @ expected)


def test_where_nothing_can_be_kept_a_loop_is_compiled_each_time():
    """A function without a file has no folder for its compiled code: the same error as folders that are read-only."""
    space = {}
    exec("def twice(x):\n    return 2 * x", space)
    assert compiled(space["twice"])(21) == 42
