"""Comparisons of errors block by block: what is chance, what is not, and what is rounding."""

import numpy as np
import pytest
from scipy.stats import binom

from cpfls_cli.identification.data import TorqueData
from cpfls_cli.regressor import Motion
from cpfls_cli.validation.paired import BLOCKS, compare, compare_torque, compare_windows


def test_equal_models_differ_by_chance_as_often_as_they_should():
    rng = np.random.default_rng(61)
    found = [compare(*rng.lognormal(sigma=1.0, size=(2, BLOCKS)), 1.0) for _ in range(1500)]
    # Half of the 5 % each; a little less, since the mean has to agree.
    most = binom.ppf(0.9999, 1500, 0.025)
    assert 0 < sum(one.lower for one in found) < most
    assert 0 < sum(one.higher for one in found) < most


def test_a_better_model_is_found_though_blocks_differ_by_orders_of_magnitude():
    theirs = np.logspace(-6, 0, BLOCKS)
    found = compare(0.8 * theirs * np.random.default_rng(62).uniform(0.9, 1.1, BLOCKS), theirs, 1.0)
    assert (found.lower, found.higher) == (True, False)
    assert found.ratio == pytest.approx(0.8, abs=0.08)


def test_one_bad_block_of_twenty_is_not_better():
    theirs = np.ones(BLOCKS)
    ours = np.where(np.arange(BLOCKS) == 3, 100.0, 0.9)
    found = compare(ours, theirs, 1.0)
    assert (found.lower, found.higher) == (False, False)


@pytest.mark.parametrize(("ours", "theirs"), [(1e-25, 1e-28), (0.0, 0.0), (0.3, 0.3 * (1 + 1e-9))])
def test_rounding_is_no_difference(ours, theirs):
    found = compare(np.full(BLOCKS, ours), np.full(BLOCKS, theirs), 1.0)
    assert (found.ratio, found.lower, found.higher) == (1.0, False, False)


def test_errors_beside_rounding_are_higher():
    found = compare(np.full(BLOCKS, 1e-3), np.full(BLOCKS, 1e-30), 1.0)
    assert (found.ratio, found.higher) == (np.inf, True)


def test_three_blocks_prove_nothing():
    found = compare(np.full(3, 0.1), np.ones(3), 1.0)
    assert (found.lower, found.blocks) == (False, 3)


def test_windows_that_were_lost_are_left_out():
    ours, theirs = np.ones(100), np.full(100, 2.0)
    ours[10:20], theirs[30:40] = np.nan, np.nan
    found = compare_windows(ours, theirs, 1.0)
    assert (found.ratio, found.lower) == (0.5, True)
    assert compare_windows(np.full(5, np.nan), theirs[:5], 1.0).blocks == 0


def flight(torque, attitude):
    zero = np.zeros_like(torque)
    return TorqueData(np.arange(len(torque)), Motion(attitude, zero, zero), torque)


def test_torque_is_scaled_by_axis_and_left_out_where_the_pitch_is_vertical():
    rng = np.random.default_rng(63)
    torque = rng.standard_normal((400, 3)) * [10.0, 1.0, 0.1]
    attitude = np.zeros((400, 3))
    attitude[::7, 1] = np.pi / 2
    told = np.arange(400) % 7 != 0
    parts = {"one": flight(torque, attitude)}
    found = compare_torque(
        parts, lambda motion: 0.9 * torque[: len(motion)], lambda motion: 0.8 * torque[: len(motion)]
    )
    scaled = np.sum((0.1 * torque[told]) ** 2 / np.mean(torque[told] ** 2, axis=0), axis=1)
    assert found.ours == pytest.approx(np.mean(scaled), rel=0.01)
    assert found.ratio == pytest.approx(0.25)
    assert found.lower
    assert found.blocks == BLOCKS


def test_nothing_held_out_is_nothing_to_compare():
    assert compare_torque({}, np.zeros_like, np.zeros_like) is None
