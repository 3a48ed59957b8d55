"""Comparisons of errors block by block: chance, what is not, and rounding; the constant torque that is missed."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

from cpfls_cli.blocks import MOST_COMPARED
from cpfls_cli.identification.data import Flights, TorqueData
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.rotations import generalised_torque
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
from tests.builders.flights import still_flight

CONSTANT = np.array([0.4, -0.3, 0.2])


def test_equal_models_differ_by_chance_as_often_as_they_should():
    rng = np.random.default_rng(61)
    found = [compare_errors(*rng.lognormal(sigma=1.0, size=(2, MOST_COMPARED)), 1.0) for _ in range(1500)]
    # Half of the 5 % each; a little less, since the mean has to agree.
    most = binom.ppf(0.9999, 1500, 0.025)
    assert 0 < sum(one.lower for one in found) < most
    assert 0 < sum(one.higher for one in found) < most


def test_a_better_model_is_found_though_blocks_differ_by_orders_of_magnitude():
    theirs = np.logspace(-6, 0, MOST_COMPARED)
    found = compare_errors(0.8 * theirs * np.random.default_rng(62).uniform(0.9, 1.1, MOST_COMPARED), theirs, 1.0)
    assert (found.lower, found.higher) == (True, False)
    assert found.ratio == pytest.approx(0.8, abs=0.08)


def test_one_bad_block_of_twenty_is_not_better():
    theirs = np.ones(MOST_COMPARED)
    ours = np.where(np.arange(MOST_COMPARED) == 3, 100.0, 0.9)
    found = compare_errors(ours, theirs, 1.0)
    assert (found.lower, found.higher) == (False, False)


@pytest.mark.parametrize(("ours", "theirs"), [(1e-25, 1e-28), (0.0, 0.0), (0.3, 0.3 * (1 + 1e-9))])
def test_rounding_is_no_difference(ours, theirs):
    found = compare_errors(np.full(MOST_COMPARED, ours), np.full(MOST_COMPARED, theirs), 1.0)
    assert (found.ratio, found.lower, found.higher) == (1.0, False, False)


def test_errors_beside_rounding_are_higher():
    found = compare_errors(np.full(MOST_COMPARED, 1e-3), np.full(MOST_COMPARED, 1e-30), 1.0)
    assert (found.ratio, found.higher) == (np.inf, True)


def test_three_blocks_prove_nothing():
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
    rng = np.random.default_rng(63)
    torque = rng.standard_normal((400, 3)) * [10.0, 1.0, 0.1]
    attitude = np.zeros((400, 3))
    attitude[::7, 1] = np.pi / 2
    told = np.arange(400) % 7 != 0
    found = compare_torque(
        still_flight(torque, attitude),
        lambda motion: 0.9 * torque[: len(motion)],
        lambda motion: 0.8 * torque[: len(motion)],
    )
    scaled = np.sum((0.1 * torque[told]) ** 2 / np.mean(torque[told] ** 2, axis=0), axis=1)
    assert found.ours == pytest.approx(np.mean(scaled), rel=0.01)
    assert found.ratio == pytest.approx(0.25)
    assert found.lower
    # 342 samples are left, and a block has 20.
    assert found.blocks == 17


def test_a_vertical_pitch_throughout_is_nothing_to_compare():
    data = still_flight(np.ones((50, 3)), np.tile([0.0, np.pi / 2, 0.0], (50, 1)))
    assert compare_torque(data, lambda motion: motion.rate, lambda motion: motion.rate).blocks == 0


def coloured(rng, samples, memory):
    share = np.exp(-1 / memory)
    white = rng.standard_normal((300 + samples, 3))
    return lfilter([np.sqrt(1 - share**2)], [1, -share], white, axis=0)[300:]


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


def test_a_constant_is_found_in_body_axes_whatever_the_attitude():
    both = Flights((pushed_flight(), pushed_flight(93)))
    np.testing.assert_allclose(mean_missing_torque(both, predicted), CONSTANT, rtol=1e-9)


def test_put_back_nothing_is_missing():
    data = pushed_flight()
    np.testing.assert_allclose(with_constant(predicted, CONSTANT)(data.motion), data.torque, atol=1e-12)


def test_a_vertical_pitch_throughout_tells_nothing():
    np.testing.assert_array_equal(mean_missing_torque(pushed_flight()[::9], predicted), np.zeros(3))
