"""Scores, folds, findings and the judge of a model."""

import numpy as np
import pytest

from cpfls_cli.dynamics import inertia_matrix, newton_euler_torque, not_positive_definite, why_unphysical
from cpfls_cli.errors import ComputationError
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.findings import axis_evidence, constant_inertia_columns, fit_baselines, score_of
from cpfls_cli.identification.identify import Judged, identify
from cpfls_cli.identification.samples import Products
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.identification.solver import SMALLEST_ERROR, contiguous_blocks, ridge_curve
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.rotations import body_rate, generalised_torque
from tests.builders.flights import random_motion, still_flight

RIGID = 6
WEIGHTS = np.geomspace(1e-6, 1e2, 5)
PARAMETERS = np.array([0.6, 0.7, 1.2, 0.05, -0.08, 0.1])
INERTIA = np.array([0.6, 0.7, 1.2, 0.0, 0.0, 0.0])


def scores(model, rigid, zero=(1.0, 1.0, 1.0)):
    mse = np.array([[model], [rigid], [zero]])
    names, parts, samples = ("model", "rigid-body", "torque-zero"), ("training",), np.array([10])
    measures = dict.fromkeys(("mse", "max_error", "relative_error", "r2", "vaf", "r2_body"), mse)
    return Judged(models=names, parts=parts, samples=samples, outside=0 * samples, **measures)


def test_the_smaller_mean_squared_error_wins_axis_by_axis_and_rounding_is_a_tie():
    assert scores((0.1, 0.3, 0.2), (0.2, 0.2, 0.2)).winners("training") == ["model", "rigid-body", "tie"]
    assert scores((3e-28, 1e-30, 2e-29), (1e-33, 2e-34, 1e-33)).winners("training") == ["tie"] * 3
    small = (1e-26, 1e-26, 1e-26)
    assert scores((3e-28, 3e-28, 3e-28), (1e-33, 1e-33, 1e-33), small).winners("training") == ["rigid-body"] * 3


def test_the_worst_axis_is_named_and_an_axis_without_torque_is_passed_over():
    error, axis = scores((0.1, 0.3, np.nan), (0.1, 0.1, 0.1)).worst("model", "training")
    assert (error, axis) == (pytest.approx(0.3), "pitch")


def problem(fuzzy=9, samples=60, share=0.3, noise=0.5):
    """Rows of a rigid part and of a fuzzy part that matters by its share."""
    rng = np.random.default_rng(13)
    rows = rng.standard_normal((samples, 3, RIGID + fuzzy))
    truth = rng.standard_normal(RIGID + fuzzy) * np.where(np.arange(RIGID + fuzzy) < RIGID, 1.0, share)
    return rows, rows @ truth + noise * rng.standard_normal((samples, 3)), 0.01 * np.arange(samples)


def products(rows, right_side, label, labels):
    """Sums of products by label."""
    parts = [(rows[label == own].reshape(-1, rows.shape[2]), right_side[label == own].ravel()) for own in range(labels)]
    return Products(
        np.array([A.T @ A for A, _ in parts]),
        np.array([A.T @ y for A, y in parts]),
        np.array([y @ y for _, y in parts]),
        np.array([len(y) for _, y in parts]),
    )


def cross_validated(learned, judged, blocks, size=1.0):
    """The curve from labels: judged samples by their fold, learned ones by what they are left out of."""
    folds = np.arange(len(blocks.validation))
    groups, label = np.unique(blocks.left_out.T, axis=0, return_inverse=True)
    by_fold = products(*judged, folds @ blocks.validation, len(folds))
    size = np.broadcast_to(size, learned[0].shape[2] - RIGID)
    return ridge_curve(products(*learned, label.ravel(), len(groups)), by_fold, groups.T, WEIGHTS, size)


def brute_force(rows, right_side, blocks, weight):
    """Errors by block of a dense least-squares fit, the ridge as extra rows on the fuzzy columns."""
    errors = []
    for validation, left_out in zip(blocks.validation, blocks.left_out, strict=True):
        A, y = rows[~left_out].reshape(-1, rows.shape[2]), right_side[~left_out].ravel()
        if np.isinf(weight):
            A, penalty = A[:, :RIGID], np.empty((0, RIGID))
        else:
            penalty = np.sqrt(weight * len(y)) * np.eye(A.shape[1])[RIGID:]
        c = np.linalg.lstsq(np.vstack([A, penalty]), np.concatenate([y, np.zeros(len(penalty))]), rcond=None)[0]
        errors.append(np.mean((right_side[validation] - rows[validation][:, :, : len(c)] @ c) ** 2))
    return np.array(errors)


@pytest.mark.parametrize("fuzzy", [9, 150])
@pytest.mark.parametrize(("samples", "folds", "embargo"), [(60, 5, 0.0), (61, 4, 0.05), (40, 2, 0.03)])
def test_curve_is_that_of_a_refit_per_block_and_weight(fuzzy, samples, folds, embargo):
    rows, right_side, time = problem(fuzzy, samples)
    blocks = contiguous_blocks(time, time, folds, embargo)
    curve = cross_validated(*[(rows, right_side)] * 2, blocks)
    np.testing.assert_array_equal(curve.weight, [*WEIGHTS, np.inf])
    errors = np.array([brute_force(rows, right_side, blocks, weight) for weight in curve.weight])
    size = blocks.validation.sum(axis=1)
    # A tiny ridge on fewer rows than columns is where normal equations lose digits.
    np.testing.assert_allclose(curve.error, errors @ size / size.sum(), rtol=1e-6)
    np.testing.assert_allclose(curve.standard_error, errors.std(axis=1, ddof=1) / np.sqrt(folds), rtol=1e-5)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.05, 0.3])
def test_chosen_weight_is_the_largest_within_one_standard_error(share):
    rows, right_side, time = problem(share=share)
    curve = cross_validated(*[(rows, right_side)] * 2, contiguous_blocks(time, time, 5, 0.0))
    best = np.argmin(curve.error)
    good = [
        w for w, e in zip(curve.weight, curve.error, strict=True) if e <= curve.error[best] + curve.standard_error[best]
    ]
    assert curve.weight[curve.chosen] == max(good)


def test_a_useless_fuzzy_part_is_switched_off_and_a_useful_one_is_not():
    chosen = []
    for share in (0.0, 1.0):
        rows, right_side, time = problem(share=share)
        curve = cross_validated(*[(rows, right_side)] * 2, contiguous_blocks(time, time, 5, 0.0))
        chosen.append(curve.weight[curve.chosen])
    assert chosen[0] == np.inf
    assert chosen[1] < 1


def test_dependent_rigid_columns_are_allowed():
    rows, right_side, time = problem()
    rows[:, :, 5] = rows[:, :, 0]
    blocks = contiguous_blocks(time, time, 5, 0.0)
    curve = cross_validated(*[(rows, right_side)] * 2, blocks)
    errors = np.array([brute_force(rows, right_side, blocks, weight).mean() for weight in curve.weight])
    np.testing.assert_allclose(curve.error, errors, rtol=1e-6)


def test_ridge_holds_the_coefficients_of_columns_divided_by_their_size():
    rows, right_side, time = problem()
    size = np.geomspace(1e-3, 1e3, 9)
    blocks = contiguous_blocks(time, time, 5, 0.02)
    unit = rows / np.append(np.ones(RIGID), size)
    curve, expected = (
        cross_validated(*[(own, right_side)] * 2, blocks, divide) for own, divide in ((rows, size), (unit, 1.0))
    )
    np.testing.assert_allclose(curve.error, expected.error, rtol=1e-9)


def test_errors_that_only_rounding_separates_count_as_equal():
    """Exact data, which any small ridge and none at all meet: the fuzzy part is off."""
    rows, right_side, time = problem(share=0.0, noise=0.0)
    curve = cross_validated(*[(rows, right_side)] * 2, contiguous_blocks(time, time, 5, 0.0))
    assert curve.error[-1] == pytest.approx(SMALLEST_ERROR * np.mean(right_side**2))
    assert curve.weight[curve.chosen] == np.inf


def score(data, predicted):
    return score_of(data, lambda _: predicted)


def test_by_hand():
    judged = score(still_flight([[1, 0, 2], [3, 0, 2], [5, 0, 2]]), np.array([[1, 1, 2], [2, 0, 2], [7, 0, 1]]))
    np.testing.assert_allclose(judged.mse, [5 / 3, 1 / 3, 1 / 3])
    np.testing.assert_allclose(judged.max_error, [2, 1, 1])
    np.testing.assert_allclose(judged.relative_error, [2 / 5, np.nan, 1 / 2])
    # Sum of squares about the mean is 8 for roll; pitch and yaw do not vary.
    np.testing.assert_allclose(judged.r2, [1 - 5 / 8, np.nan, np.nan])
    np.testing.assert_allclose(judged.r2_body, judged.r2)


def test_variance_accounted_for_forgives_a_constant():
    """Errors of 3, 4 and 5 have the variance of -1, 0 and 1."""
    data = still_flight([[1, 0, 2], [3, 1, 2], [5, 8, 2]])
    judged = score(data, data.torque - [[3, 7, 0], [4, 7, 0], [5, 7, 1]])
    np.testing.assert_allclose(judged.vaf, [1 - 2 / 8, 1.0, np.nan])
    np.testing.assert_allclose(judged.r2, [1 - 50 / 8, 1 - 147 / 38, np.nan])


def test_body_axes():
    """At 90 degrees of roll the Euler pitch torque is the body's negative yaw torque."""
    torque = [[1, 2, 5], [2, -3, 4], [4, 9, 1]]
    rolled = np.tile([np.pi / 2, 0.0, 0.0], (3, 1))
    judged = score(still_flight(torque, rolled), np.add(torque, [[0, 1, 0], [0, 0, 0], [0, 0, 2]]))
    np.testing.assert_allclose(judged.r2_body, judged.r2[[0, 2, 1]], rtol=1e-12)


def test_body_torque_is_judged_where_the_pitch_is_not_vertical():
    """Near +-90 degrees it is divided by next to nothing: one such sample would outweigh all others."""
    rng = np.random.default_rng(7)
    attitude, torque, error = rng.uniform(-1.2, 1.2, (40, 3)), *rng.standard_normal((2, 40, 3))
    rest, steep = np.arange(40) != 5, attitude.copy()
    steep[5, 1] = np.pi / 2 - 1e-7
    judged = score(still_flight(torque, steep), torque + 0.1 * error)
    others = score(still_flight(torque[rest], steep[rest]), (torque + 0.1 * error)[rest])
    np.testing.assert_allclose(judged.r2_body, others.r2_body)
    assert np.all(judged.r2_body > 0.8)
    assert not np.array_equal(judged.mse, others.mse)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2 + 0.05, 4.7])
def test_a_flight_at_a_vertical_pitch_shows_nothing_of_body_torque(pitch):
    torque = np.random.default_rng(8).standard_normal((5, 3))
    judged = score(still_flight(torque, np.tile([0.3, pitch, 0.0], (5, 1))), 0.9 * torque)
    assert np.isnan(judged.r2_body).all()
    assert np.all(judged.r2 > 0.5)


@pytest.mark.parametrize(
    ("torque", "samples", "message"),
    [
        (np.zeros((3, 2)), 3, r"torque: expected shape \(time, 3\)"),
        (np.zeros((3, 3)), 4, "have 4, 4 and 3 samples"),
        (np.full((3, 3), np.nan), 3, "not finite"),
    ],
)
def test_data_that_do_not_fit_are_refused(torque, samples, message):
    zero = np.zeros((samples, 3))
    with pytest.raises(ComputationError, match=message):
        TorqueData(np.arange(samples), Motion(zero, zero, zero), torque)


def tensor(parameters):
    xx, yy, zz, xy, xz, yz = parameters
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def motion(samples=200):
    return random_motion(np.random.default_rng(17), samples, limit=1.0)


def fitted(torque):
    """Baselines by name."""
    baselines = fit_baselines(TorqueData(np.arange(200.0), motion(), torque), np.array([1.0, 2.0, 5.0]), 1e-10)
    return {baseline.name: baseline for baseline in baselines}


def test_columns_of_constant_inertia():
    expected = motion().acceleration @ tensor(PARAMETERS)
    np.testing.assert_allclose(constant_inertia_columns(motion()) @ PARAMETERS, expected, atol=1e-14)


def test_six_inertia_parameters_come_back_exactly():
    m = motion()
    torque = newton_euler_torque(m.attitude, m.rate, m.acceleration, tensor(PARAMETERS))
    by_name = fitted(torque)
    assert list(by_name) == ["rigid-body", "constant-inertia", "torque-zero"]
    np.testing.assert_allclose(by_name["rigid-body"].parameters, PARAMETERS, atol=1e-12)
    np.testing.assert_allclose(by_name["rigid-body"].torque(m), torque, atol=1e-12)
    assert np.abs(by_name["constant-inertia"].torque(m) - torque).max() > 0.1 * np.abs(torque).max()
    np.testing.assert_array_equal(by_name["torque-zero"].torque(m), np.zeros_like(torque))


def test_constant_inertia_comes_back_when_that_is_what_moved():
    by_name = fitted(motion().acceleration @ tensor(PARAMETERS))
    np.testing.assert_allclose(by_name["constant-inertia"].parameters, PARAMETERS, atol=1e-12)


def test_rows_are_weighted_by_axis():
    torque = np.random.default_rng(18).standard_normal((200, 3))
    scale = np.repeat([[1.0, 2.0, 5.0]], 200, axis=0)
    columns = constant_inertia_columns(motion())
    expected = np.linalg.lstsq((columns * scale[:, :, None]).reshape(-1, 6), (torque * scale).ravel(), rcond=None)[0]
    np.testing.assert_allclose(fitted(torque)["constant-inertia"].parameters, expected, atol=1e-12)


def test_variances_are_the_same_chunk_by_chunk(monkeypatch):
    torque, error = np.random.default_rng(9).standard_normal((2, 50, 3)) + 5.0
    data = still_flight(torque)
    monkeypatch.setattr("cpfls_cli.identification.data.CHUNK", 7)
    predicted = [(torque - error)[start : start + 7] for start in range(0, 50, 7)]
    judged = score_of(data, lambda motion: predicted.pop(0)[: len(motion)])
    np.testing.assert_allclose(judged.vaf, 1 - error.var(axis=0) / torque.var(axis=0))
    np.testing.assert_allclose(judged.r2, 1 - np.mean(error**2, axis=0) / torque.var(axis=0))


def small_angle_flight(seed=1, samples=300, yaw=1.0, tilt=0.3):
    """A flight at small angles; `yaw` scales what moves about it."""
    rng = np.random.default_rng(seed)
    scale = np.array([tilt, tilt, 0.3 * yaw])
    time = 0.02 * np.arange(samples)
    phase = np.outer(time, [2.1, 2.7, 1.7]) + rng.uniform(0, 6, 3)
    motion = Motion(
        scale * np.sin(phase),
        scale * [2.1, 2.7, 1.7] * np.cos(phase),
        -scale * np.square([2.1, 2.7, 1.7]) * np.sin(phase),
    )
    torque = newton_euler_torque(motion.attitude, motion.rate, motion.acceleration, np.diag(INERTIA[:3]))
    return TorqueData(time, motion, torque + 0.01 * rng.standard_normal(torque.shape))


def with_torque(data, torque):
    return TorqueData(data.time, data.motion, torque)


def rotations(seed=5, samples=400, tilt=4.0):
    """A flight through complete circles, and so through a vertical pitch."""
    data = small_angle_flight(seed, samples, yaw=10.0, tilt=tilt)
    motion = data.motion
    torque = newton_euler_torque(motion.attitude, motion.rate, motion.acceleration, np.diag(INERTIA[:3]))
    return with_torque(data, torque)


def result(data, held_out=None, stated=INERTIA, **changed):
    settings = IdentificationSettings(
        **{"membership_functions": 1, "consequents": "seesaw", "products": "additive", **changed}
    )
    found = identify(data, data, held_out or {}, settings, np.random.default_rng(0), stated_inertia=stated)
    return " | ".join(found.findings)


def test_a_good_flight_is_only_said_that_the_rigid_body_is_enough():
    sentences = result(small_angle_flight())
    assert "fuzzy part off" in sentences
    for word in ("positive definite", "constant torque", "hardly", "times those stated", "explains less"):
        assert word not in sentences


def test_a_wrong_sign_gives_an_inertia_that_no_body_has():
    data = small_angle_flight()
    sentences = result(with_torque(data, -data.torque))
    assert "not positive definite at 300 of 300 training samples" in sentences
    assert "check signs, axes, frames and units" in sentences


def test_a_constant_torque_is_named_with_its_size():
    data = small_angle_flight()
    offset = np.tile([0.0, -0.5, 0.0], (300, 1))
    sentences = result(with_torque(data, data.torque + generalised_torque(data.motion.attitude, offset)))
    assert "pitch: a constant torque of -0.5" in sentences
    assert "roll: a constant" not in sentences
    assert "hardly" not in sentences


def test_an_axis_that_does_not_move_is_called_hardly_excited_and_one_that_does_is_not():
    data = small_angle_flight(yaw=0.01, tilt=0.05)
    noise = 0.2 * np.random.default_rng(3).standard_normal((300, 3)) * [0, 0, 1]
    sentences = result(with_torque(data, data.torque + noise))
    assert "yaw is hardly excited: motion and a constant explain less than half" in sentences
    assert "roll is" not in sentences
    data = small_angle_flight()
    wrong = data.torque.copy()
    wrong[:, 1] = np.random.default_rng(4).standard_normal(300)
    sentences = result(with_torque(data, wrong))
    assert "pitch: something other than inertia acts, or columns are wrong" in sentences
    assert "hardly excited" not in sentences


def test_a_wrong_unit_and_another_vehicle_show_in_the_ratio_to_the_stated_inertia():
    data = small_angle_flight()
    assert "times those stated" in result(with_torque(data, 57.3 * data.torque))
    assert "times those stated" not in result(with_torque(data, 2.0 * data.torque))
    assert "times those stated" not in result(with_torque(data, 57.3 * data.torque), stated=None)
    data, other = small_angle_flight(), small_angle_flight(seed=2)
    assert "other: the model explains less than half" in result(data, {"other": with_torque(other, 5 * other.torque)})
    assert "explains less than half" not in result(data, {"other": other})


@pytest.mark.parametrize(
    ("inertia", "reason"),
    [
        ([0.6, 0.6, 1.2, 0, 0, 0], None),
        ([0.6, -0.1, 1.2, 0, 0, 0], "not positive definite"),
        ([0.6, 0.6, 1.2, 0.7, 0, 0], "not positive definite"),
        ([0.6, 0.6, 2.0, 0, 0, 0], "triangle inequality"),
        ([0, 0, 0, 0, 0, 0], "not positive definite"),
    ],
)
def test_inertia_of_a_body(inertia, reason):
    why = why_unphysical(np.array(inertia, dtype=float))
    assert (why is None) if reason is None else reason in why


def test_definiteness_is_that_of_the_eigenvalues():
    good, singular, bad = (
        np.diag([1.0, 2.0, 3.0]),
        np.diag([0.0, 2.0, 3.0]),
        np.array([[1, 2, 0], [2, 1, 0], [0, 0, 1.0]]),
    )
    assert not_positive_definite(np.stack([good, singular, bad]), np.zeros((3, 3))).tolist() == [False, False, True]


@pytest.mark.parametrize(("pitch", "smallest"), [(0.0, 0.0), (1.4, 0.0), (1.5, -0.02), (-1.5, -0.02), (4.7, -0.02)])
def test_near_a_vertical_pitch_a_matrix_may_dip_below_zero_by_a_hair(pitch, smallest):
    """There the smallest eigenvalue of every body is next to zero: 1 % of the largest one is let pass."""
    at_pitch = np.tile([0.0, pitch, 0.0], (2, 1))
    dips = np.stack([np.diag([smallest + shift, 1.0, 3.0]) for shift in (-0.005, -0.015)])
    assert not_positive_definite(dips, at_pitch).tolist() == [pitch in (0.0, 1.4), True]
    own = np.linalg.eigvalsh(inertia_matrix(at_pitch, np.diag(INERTIA[:3])))[0]
    assert (own[0] < 0.01 * own[2]) == (abs(np.cos(pitch)) < 0.1)


def test_a_flight_through_a_vertical_pitch_is_said_what_is_left_out():
    sentences = result(rotations())
    assert "body torque is judged without the samples closer than 6 degrees to a pitch of +-90 degrees" in sentences
    assert "closer than" not in result(small_angle_flight())


def test_a_structure_that_fails_on_a_good_flight_is_not_blamed_on_the_log():
    data, rules = rotations(tilt=3.0), {"base": "none", "membership_functions": 3, "population": 6, "generations": 1}
    sentences = result(data, **rules)
    assert "D(q) is not positive definite" in sentences
    assert "the structure or its excitation is at fault" in sentences
    assert "check signs" not in sentences
    assert "check signs" in result(with_torque(data, -data.torque), **rules)


def test_noise_near_a_vertical_pitch_does_not_make_an_axis_badly_explained():
    data = rotations()
    noise = 0.02 * np.random.default_rng(6).standard_normal(data.torque.shape)
    assert np.all(axis_evidence(with_torque(data, data.torque + noise), 1e-10).r2 > 0.99)


def test_constant_and_inertial_torque_are_distinguished():
    data = small_angle_flight()
    offset = np.tile([0.2, -0.5, 0.1], (300, 1))
    evidence = axis_evidence(with_torque(data, data.torque + generalised_torque(data.motion.attitude, offset)), 1e-10)
    np.testing.assert_allclose(evidence.constant, [0.2, -0.5, 0.1], atol=0.01)
    assert np.all(evidence.r2 > 0.99)
    turned = np.gradient(body_rate(data.motion.attitude, data.motion.rate), data.time, axis=0)
    np.testing.assert_allclose(evidence.acceleration, np.sqrt(np.mean(turned**2, axis=0)), rtol=0.02)
