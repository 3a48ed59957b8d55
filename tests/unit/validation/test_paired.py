"""Paired scores of structures: blocks, draws and their comparison."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import linalg
from scipy.signal import lfilter
from scipy.stats import binom

from cpfls_cli.blocks import MOST_COMPARED
from cpfls_cli.dynamics import rigid_columns
from cpfls_cli.identification.data import Flights, TorqueData, axis_scale
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings, ValidationSettings
from cpfls_cli.identification.solver import contiguous_blocks
from cpfls_cli.regressor.regressor import Motion, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.rotations import generalised_torque
from cpfls_cli.validation.bands import BlockScores
from cpfls_cli.validation.evidence import (
    block_count,
    compare_errors,
    compare_torque,
    compare_windows,
    correlation_time,
    mean_missing_torque,
    non_overlapping,
    with_constant,
)
from cpfls_cli.validation.structures import RIGID_BODY_NAME, candidate_structures, compare_structures, structure_name
from tests.builders.flights import bent_torque, random_flight, still_flight

BLOCKS, ROWS, PARAMETERS = 6, 9, 5
TOLERANCE = 1e-10
CONSTANT = np.array([0.4, -0.3, 0.2])
SAMPLES = 300
VALIDATION = ValidationSettings(folds=4)


@pytest.fixture(params=[0.0, 3.0], ids=["free", "penalised"])
def case(request):
    rng = np.random.default_rng(1)
    A, y = rng.standard_normal((BLOCKS, ROWS, PARAMETERS)), rng.standard_normal((BLOCKS, ROWS))
    penalty = request.param * np.array([0.0, 0.0, 1.0, 1.0, 2.0])
    x = solved(A, y, penalty)
    gram, score = A.swapaxes(1, 2) @ A, np.einsum("bnp,bn->bp", A, y - A @ x)
    return SimpleNamespace(A=A, y=y, penalty=penalty, x=x, scores=BlockScores(gram, score, penalty, x))


def solved(A, y, penalty):
    rows = np.vstack([A.reshape(-1, PARAMETERS), np.diag(np.sqrt(penalty))])
    return linalg.lstsq(rows, np.append(y.ravel(), np.zeros(PARAMETERS)))[0]


def test_power_one_is_what_leaving_a_block_out_changes(case):
    """The jackknife: each draw of one block alone is a least-squares problem without it."""
    scores = BlockScores(case.scores.gram, case.scores.score, case.penalty, case.x, power=1.0)
    for block, moved in enumerate(scores.draws(np.eye(BLOCKS), TOLERANCE)):
        left = np.arange(BLOCKS) != block
        np.testing.assert_allclose(moved, case.x - solved(case.A[left], case.y[left], case.penalty), atol=1e-12)


@pytest.mark.parametrize("power", [0.0, 0.5, 0.75])
def test_other_powers_correct_the_residuals_themselves(case, power):
    scores = BlockScores(case.scores.gram, case.scores.score, case.penalty, case.x, power)
    inverse = np.linalg.inv(np.sum(case.scores.gram, axis=0) + np.diag(case.penalty))
    for A, y, moved in zip(case.A, case.y, scores.draws(np.eye(BLOCKS), TOLERANCE), strict=True):
        rest = np.eye(ROWS) - A @ inverse @ A.T
        residual = linalg.fractional_matrix_power(rest, -power) @ (y - A @ case.x)
        np.testing.assert_allclose(moved, inverse @ A.T @ residual, atol=1e-12)


def test_another_penalty_is_that_of_all_rows_solved_again(case):
    penalty = np.array([0.0, 0.0, 0.1, 0.3, 0.2])
    other = case.scores.with_penalty(penalty, TOLERANCE)
    np.testing.assert_allclose(other.parameters, solved(case.A, case.y, penalty), atol=1e-12)
    residual = case.y - case.A @ other.parameters
    np.testing.assert_allclose(other.score, np.einsum("bnp,bn->bp", case.A, residual), atol=1e-12)
    np.testing.assert_array_equal(other.penalty, penalty)


def test_left_is_what_samples_do_not_tell_of_values_that_are_true(case):
    values = (case.penalty > 0) * np.random.default_rng(3).standard_normal((4, PARAMETERS))
    expected = [value - solved(case.A, case.A @ value, case.penalty) for value in values]
    np.testing.assert_allclose(case.scores.undetermined(values, TOLERANCE), expected, atol=1e-12)


@pytest.mark.parametrize("penalty", [0.0, 1e-30, 1e-3], ids=["none", "rounding", "some"])
def test_all_is_left_of_a_direction_that_no_sample_sees(penalty):
    scores = BlockScores(np.diag([4.0, 1.0, 0.0])[None], np.zeros((1, 3)), np.full(3, penalty), np.ones(3))
    left = scores.undetermined(np.array([[3.0, -2.0, 5.0]]), TOLERANCE)
    np.testing.assert_allclose(left, [[3.0 * penalty / (4 + penalty), -2.0 * penalty / (1 + penalty), 5.0]], atol=1e-15)


def test_solution_is_that_of_least_squares(case):
    scores = BlockScores(case.scores.gram, np.einsum("bnp,bn->bp", case.A, case.y), case.penalty, 0 * case.x)
    np.testing.assert_allclose(scores.solution(TOLERANCE), case.x, atol=1e-12)


def test_directions_that_nothing_determines_stay_where_they_are():
    rng = np.random.default_rng(2)
    A = rng.standard_normal((BLOCKS, ROWS, 4)) @ rng.standard_normal((4, PARAMETERS))
    moved = BlockScores(
        A.swapaxes(1, 2) @ A,
        np.einsum("bnp,bn->bp", A, rng.standard_normal((BLOCKS, ROWS))),
        np.zeros(PARAMETERS),
        np.zeros(PARAMETERS),
    ).draws(rng.standard_normal((50, BLOCKS)), 1e-6)
    null = linalg.null_space(A.reshape(-1, PARAMETERS))
    assert null.shape[1] == 1
    assert np.abs(moved).max() > 0.01
    np.testing.assert_allclose(moved @ null, 0.0, atol=1e-9)


def test_a_block_that_alone_determines_a_direction_gives_finite_draws():
    gram = np.zeros((2, 2, 2))
    gram[0, 0, 0] = gram[1, 1, 1] = 1.0
    scores = BlockScores(gram, np.zeros((2, 2)), np.zeros(2), np.ones(2), power=1.0)
    np.testing.assert_array_equal(scores.draws(np.ones((3, 2)), TOLERANCE), np.zeros((3, 2)))


def test_equal_models_differ_by_chance_as_often_as_they_should():
    rng = np.random.default_rng(61)
    found = [compare_errors(*rng.lognormal(sigma=1.0, size=(2, MOST_COMPARED)), 1.0) for _ in range(1500)]
    # Half of the 5 % each; a little less, since the mean has to agree.
    most = binom.ppf(0.9999, 1500, 0.025)
    assert 0 < sum(one.lower for one in found) < most
    assert 0 < sum(one.higher for one in found) < most


def test_a_better_model_is_found_and_one_bad_block_of_twenty_is_not_better():
    theirs = np.logspace(-6, 0, MOST_COMPARED)
    found = compare_errors(0.8 * theirs * np.random.default_rng(62).uniform(0.9, 1.1, MOST_COMPARED), theirs, 1.0)
    assert (found.lower, found.higher) == (True, False)
    assert found.ratio == pytest.approx(0.8, abs=0.08)
    theirs = np.ones(MOST_COMPARED)
    found = compare_errors(np.where(np.arange(MOST_COMPARED) == 3, 100.0, 0.9), theirs, 1.0)
    assert (found.lower, found.higher) == (False, False)


@pytest.mark.parametrize(("ours", "theirs"), [(1e-25, 1e-28), (0.0, 0.0), (0.3, 0.3 * (1 + 1e-9))])
def test_rounding_is_no_difference(ours, theirs):
    found = compare_errors(np.full(MOST_COMPARED, ours), np.full(MOST_COMPARED, theirs), 1.0)
    assert (found.ratio, found.lower, found.higher) == (1.0, False, False)


def test_errors_next_to_rounding_are_higher_and_three_blocks_prove_nothing():
    found = compare_errors(np.full(MOST_COMPARED, 1e-3), np.full(MOST_COMPARED, 1e-30), 1.0)
    assert (found.ratio, found.higher) == (np.inf, True)
    found = compare_errors(np.full(3, 0.1), np.ones(3), 1.0)
    assert (found.lower, found.blocks) == (False, 3)


def windows(ours, theirs, size=1.0):
    return compare_windows(ours, theirs, size, np.arange(len(ours)) * MOST_COMPARED // len(ours))


def test_windows_that_one_lost_speak_for_the_other():
    ours, theirs = np.ones(100), np.full(100, 2.0)
    assert windows(ours, theirs).lower
    ours[:90] = np.nan
    assert (windows(ours, theirs).lower, windows(ours, theirs).higher) == (False, True)
    assert windows(theirs, ours).lower


def test_windows_that_both_lost_are_left_out():
    ours, theirs = np.ones(100), np.full(100, 2.0)
    ours[10:20] = theirs[10:20] = np.nan
    found = windows(ours, theirs)
    assert (found.ratio, found.lower, found.blocks) == (0.5, True, 18)
    none = windows(np.full(5, np.nan), np.full(5, np.nan))
    assert (none.blocks, none.lower, none.higher) == (0, False, False)


def test_all_windows_lost_is_worse_than_any():
    found = windows(np.full(40, np.nan), np.random.default_rng(64).lognormal(size=40))
    assert (found.lower, found.higher) == (False, True)


def test_windows_apart_do_not_overlap():
    start = np.array([0, 3, 10, 12, 19, 20, 50])
    np.testing.assert_array_equal(start[non_overlapping(start, 10)], [0, 10, 20, 50])
    assert len(non_overlapping(start[:0], 10)) == 0


def test_torque_is_scaled_by_axis_and_left_out_where_the_pitch_is_vertical():
    torque = np.random.default_rng(63).standard_normal((400, 3)) * [10.0, 1.0, 0.1]
    attitude = np.zeros((400, 3))
    attitude[::7, 1] = np.pi / 2
    result = np.arange(400) % 7 != 0
    found = compare_torque(
        still_flight(torque, attitude),
        lambda motion: 0.9 * torque[: len(motion)],
        lambda motion: 0.8 * torque[: len(motion)],
    )
    scaled = np.sum((0.1 * torque[result]) ** 2 / np.mean(torque[result] ** 2, axis=0), axis=1)
    assert (found.ours, found.ratio) == (pytest.approx(np.mean(scaled), rel=0.01), pytest.approx(0.25))
    assert found.lower
    # 342 samples are left, and a block has 20.
    assert found.blocks == 17


def test_a_vertical_pitch_throughout_is_nothing_to_compare():
    data = still_flight(np.ones((50, 3)), np.tile([0.0, np.pi / 2, 0.0], (50, 1)))
    assert compare_torque(data, lambda motion: motion.rate, lambda motion: motion.rate).blocks == 0


def coloured(rng, samples, memory):
    share = np.exp(-1 / memory)
    return lfilter([np.sqrt(1 - share**2)], [1, -share], rng.standard_normal((300 + samples, 3)), axis=0)[300:]


@pytest.mark.parametrize("samples", [40, 100, 200, 1000])
@pytest.mark.parametrize("memory", [5, 20])
def test_errors_that_remember_each_other_seldom_prove_what_is_not_so(samples, memory):
    """Two models that are equally wrong, on a hold-out from far too short to long."""
    rng, proved = np.random.default_rng(65), 0
    for _ in range(200):
        noise, ours, theirs = (coloured(rng, samples, memory) for _ in range(3))
        data = still_flight(5 * coloured(rng, samples, memory), np.zeros((samples, 3)))
        found = compare_torque(
            data, lambda _, d=data, e=noise + ours: d.torque + e, lambda _, d=data, e=noise + theirs: d.torque + e
        )
        proved += found.lower + found.higher
    # Both directions; 0.05 of each would be 20 of 200, and 4 more by the chance of this test.
    assert proved <= 24


def test_blocks_are_at_least_four_correlation_times_long():
    rng = np.random.default_rng(66)
    assert block_count(rng.standard_normal((5000, 3))) == MOST_COMPARED
    assert block_count(rng.standard_normal((99, 3))) == 4
    slow = np.sin(2 * np.pi * np.arange(1000) / 400)[:, None]
    # cos reaches 1/e at 0.19 of a period of 400 samples; the end of the flight takes a little off.
    assert correlation_time(slow) == pytest.approx(75, abs=8)
    assert block_count(slow) == 1000 // (4 * correlation_time(slow))
    assert correlation_time(np.ones((50, 2))) == 0
    assert block_count(np.zeros((0, 3))) == 1


def pushed_flight(seed=92, samples=200):
    rng = np.random.default_rng(seed)
    attitude = rng.uniform(-np.pi, np.pi, (samples, 3))
    attitude[::9, 1] = np.pi / 2
    motion = Motion(attitude, rng.standard_normal((samples, 3)), np.zeros((samples, 3)))
    return TorqueData(
        np.arange(samples), motion, 2 * motion.rate + generalised_torque(attitude, np.tile(CONSTANT, (samples, 1)))
    )


def predicted(motion):
    return 2 * motion.rate


def test_a_constant_is_found_in_body_axes_and_put_back_nothing_is_missing():
    both = Flights((pushed_flight(), pushed_flight(93)))
    np.testing.assert_allclose(mean_missing_torque(both, predicted), CONSTANT, rtol=1e-9)
    data = pushed_flight()
    np.testing.assert_allclose(with_constant(predicted, CONSTANT)(data.motion), data.torque, atol=1e-12)
    np.testing.assert_array_equal(mean_missing_torque(pushed_flight()[::9], predicted), np.zeros(3))


OWN = [
    {},
    {"membership_functions": 3},
    {"consequents": "seesaw", "products": "additive", "membership_functions": 5, "input_map": "data-range"},
    {"consequents": "seesaw", "structure": "fls", "membership_functions": (1, 2, 3, 4, 3, 2)},
    {"harmonic_order": 8, "products": "additive"},
]


@pytest.mark.parametrize("keys", OWN)
def test_the_own_structure_comes_first_and_every_name_once(keys):
    own = StructureSettings(**keys)
    listed = candidate_structures(own)
    assert listed[0] == own
    names = [structure_name(structure) for structure in listed]
    assert len(set(names)) == len(names)
    assert 5 <= len(names) <= 12
    assert {1, 3, 5}.issubset(structure.membership_functions for structure in listed)
    assert {"full-circle", "data-range"} == {structure.input_map for structure in listed}
    harmonic = {structure.harmonic_order for structure in listed if structure.consequents == "harmonic"}
    assert {1, 2, 3}.issubset(harmonic)
    assert any(structure.consequents == "seesaw" for structure in listed)
    assert all(model_structure(structure).parameters > 0 for structure in listed)


def test_settings_of_an_identification_are_a_structure_and_one_rule_has_no_use_for_an_input_map():
    assert candidate_structures(IdentificationSettings()) == candidate_structures(StructureSettings())
    one_rule = [
        s for s in candidate_structures(StructureSettings()) if s.membership_functions == 1 and s.harmonic_order == 2
    ]
    assert len(one_rule) == 1


@pytest.mark.parametrize(
    ("keys", "name"),
    [
        (OWN[0], "harmonic 2 tensor, 1 function, full-circle"),
        (OWN[2], "seesaw additive, 5 functions, data-range"),
        (OWN[3], "seesaw tensor, 1-2-3-4-3-2 functions, full-circle, classic"),
    ],
)
def test_names(keys, name):
    assert structure_name(StructureSettings(**keys)) == name


def bending_flight(bent=0.0, noise=0.05, samples=SAMPLES):
    """Torque of a rigid body, or of one with 0.5 cos(roll) added to D22."""
    return random_flight(bent_torque(size=0.5 * bent), 11, samples, noise=noise)


def settings(base, **keys):
    return IdentificationSettings(**keys, base=base, validation=VALIDATION)


@pytest.mark.parametrize("every", [1, 2], ids=["all", "selection"])
def test_without_a_rigid_body_errors_are_those_of_refits(every):
    training = bending_flight()
    learned = training[::every]
    keys = {"harmonic_order": 1, "products": "additive"}
    compared = compare_structures(training, learned, settings("none", **keys))
    blocks = contiguous_blocks(training.time, learned.time, 4, IdentificationSettings().ridge.embargo_s)
    scale = 1 / axis_scale(learned)

    def errors(columns):
        found = []
        for judged, left_out in zip(blocks.validation, blocks.left_out, strict=True):
            part, rest = learned[np.flatnonzero(~left_out)], training[np.flatnonzero(judged)]
            x = linalg.lstsq(columns(part.motion).reshape(part.torque.size, -1), part.torque.ravel())[0]
            found.append(np.mean(((rest.torque - columns(rest.motion) @ x) * scale) ** 2))
        return np.mean(found), np.std(found, ddof=1) / 2

    def fuzzy(m):
        ranges = data_ranges(structure, training.motion.attitude)
        return Regressor(structure, m, ranges).matrix(uniform_breakpoints(structure))

    structure = model_structure(candidate_structures(settings("none", **keys))[0])
    own = int(np.flatnonzero(compared.own)[0])
    for place, columns in ((0, rigid_columns), (own, fuzzy)):
        assert (compared.error[place], compared.standard_error[place]) == pytest.approx(errors(columns), rel=1e-8)
    assert compared.name[0] == RIGID_BODY_NAME
    assert compared.parameters[[0, own]].tolist() == [0, structure.parameters]
    assert np.isinf(compared.ridge_weight[0])
    assert np.all(compared.ridge_weight[1:] == 0)


def test_over_a_rigid_body_it_is_the_ridge_curve_of_the_structure():
    training, chosen = bending_flight(bent=1.0), settings("rigid-body", harmonic_order=1)
    compared = compare_structures(training, training, chosen)
    evaluator = model_evaluator(training, training, replace(chosen, ridge=replace(chosen.ridge, folds=4)))
    curve = evaluator.solver.curve(uniform_breakpoints(evaluator.structure))
    own = int(np.flatnonzero(compared.own)[0])
    assert compared.error[own] == pytest.approx(curve.error[curve.chosen])
    assert compared.standard_error[own] == pytest.approx(curve.standard_error[curve.chosen])
    assert compared.ridge_weight[own] == pytest.approx(curve.weight[curve.chosen])
    assert compared.error[0] == pytest.approx(curve.error[-1])


@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_what_the_flight_holds_decides(base):
    """A rigid vehicle leaves nothing to gain; one that bends does, for harmonics of one rule."""
    for bent in (0.0, 1.0):
        data = bending_flight(bent, samples=1500)
        compared = compare_structures(data, data, settings(base))
        best = int(np.argmin(compared.error))
        gain = compared.error[0] - compared.error[best]
        assert (gain > 3 * compared.standard_error[best]) == bool(bent)
        assert np.sum(compared.own) == 1
    assert compared.name[best].startswith("harmonic")


def test_structures_that_the_samples_cannot_tell_are_left_out():
    few = bending_flight(samples=60)
    compared = compare_structures(few, few, settings("none"))
    assert compared.name[0] == RIGID_BODY_NAME
    assert np.max(compared.parameters) <= 3 * 45
    assert np.isfinite(compared.error).all()
    data = bending_flight()
    assert not compare_structures(data, data, settings("none", harmonic_order=8, membership_functions=9)).own.any()


@pytest.mark.parametrize("base", ["none", "rigid-body"])
def test_too_few_samples_for_the_folds_compare_nothing(base):
    few = bending_flight(samples=7)
    compared = compare_structures(few, few, settings(base))
    assert compared.name == ()
    assert all(len(values) == 0 for values in vars(compared).values())


def test_a_long_flight_is_compared_on_pieces_of_it():
    data = bending_flight(samples=4000)
    few = replace(settings("none"), validation=ValidationSettings(samples=400))
    pieces = (np.arange(20)[:, None] * 200 + np.arange(20)).ravel()
    whole, part = compare_structures(data, data, few), compare_structures(data[pieces], data[pieces], few)
    np.testing.assert_allclose(whole.error, part.error)
    assert whole.name == part.name
