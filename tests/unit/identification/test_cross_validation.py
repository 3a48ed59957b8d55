"""Ridge weight by blocked cross-validation against a refit for every block and weight."""

import numpy as np
import pytest

from cpfls_cli.identification.samples import Products
from cpfls_cli.identification.solver import SMALLEST_ERROR, contiguous_blocks, ridge_curve

RIGID = 6
WEIGHTS = np.geomspace(1e-6, 1e2, 5)


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


def test_errors_that_only_rounding_tells_apart_count_as_equal():
    """Exact data, which any small ridge and none at all meet: the fuzzy part is off."""
    rows, right_side, time = problem(share=0.0, noise=0.0)
    curve = cross_validated(*[(rows, right_side)] * 2, contiguous_blocks(time, time, 5, 0.0))
    assert curve.error[-1] == pytest.approx(SMALLEST_ERROR * np.mean(right_side**2))
    assert curve.weight[curve.chosen] == np.inf
