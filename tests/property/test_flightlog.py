"""Conversion and repair of any log."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

from cpfls_cli.flightlog.conversion import attitude_from_quaternion, attitude_to_enu_flu, body_to_flu, world_to_enu
from cpfls_cli.flightlog.repair import count_saturated, fill, find_spikes, increasing_rows
from cpfls_cli.rotations import rotation_matrix

ANGLE = st.floats(-3.1, 3.1)
ATTITUDE = st.tuples(ANGLE, st.floats(-1.5, 1.5), ANGLE).map(lambda angles: np.array([angles]))
VECTOR = st.tuples(*[st.floats(-10, 10)] * 3).map(lambda entries: np.array([entries]))
STAMPS = hnp.arrays(float, st.integers(2, 40), elements=st.one_of(st.integers(0, 20).map(float), st.just(np.nan)))


@pytest.mark.parametrize("body", ["FLU", "FRD"])
@pytest.mark.parametrize("world", ["ENU", "NED"])
@given(attitude=ATTITUDE)
def test_converting_twice_gives_the_attitude_back(attitude, body, world):
    """Both changes of axes are their own inverses."""
    there_and_back = attitude_to_enu_flu(attitude_to_enu_flu(attitude, body, world), body, world)
    np.testing.assert_allclose(rotation_matrix(there_and_back), rotation_matrix(attitude), atol=1e-7)


@pytest.mark.parametrize("body", ["FLU", "FRD"])
@pytest.mark.parametrize("world", ["ENU", "NED"])
@given(attitude=ATTITUDE, vector=VECTOR)
def test_rotating_then_converting_is_converting_then_rotating(attitude, vector, body, world):
    by_scipy = Rotation.from_euler("ZYX", attitude[:, ::-1]).apply(vector)
    converted = rotation_matrix(attitude_to_enu_flu(attitude, body, world))[0] @ body_to_flu(vector, body)[0]
    np.testing.assert_allclose(converted, world_to_enu(by_scipy, world)[0], atol=1e-6)


@given(attitude=ATTITUDE, length=st.floats(0.1, 10), sign=st.sampled_from([-1, 1]))
def test_a_quaternion_of_any_length_and_sign_gives_its_attitude(attitude, length, sign):
    quaternion = sign * length * Rotation.from_euler("ZYX", attitude[:, ::-1]).as_quat()
    for order, entries in (("xyzw", quaternion), ("wxyz", quaternion[:, [3, 0, 1, 2]])):
        np.testing.assert_allclose(attitude_from_quaternion(entries, order), attitude, atol=1e-6)


@given(STAMPS)
def test_kept_time_stamps_increase_and_every_other_row_has_one_reason(stamps):
    kept, dropped = increasing_rows(stamps)
    assert (np.diff(stamps[kept]) > 0).all()
    assert len(kept) + sum(dropped.values()) == len(stamps)


@given(STAMPS)
def test_rows_are_kept_as_a_plain_loop_keeps_them(stamps):
    latest, expected = -np.inf, []
    for row, stamp in enumerate(stamps):
        if stamp > latest:
            latest = stamp
            expected.append(row)
    np.testing.assert_array_equal(increasing_rows(stamps)[0], expected)


@given(
    hnp.arrays(float, 30, elements=st.sampled_from([0.0, 1.0, 2.0])),
    st.integers(2, 6),
    st.sampled_from([None, 0.0, 1.0, 2.0]),
)
def test_saturated_values_are_counted_as_a_plain_loop_counts_them(values, samples, rest):
    count, run = 0, 0
    for row, value in enumerate(values):
        run = run + 1 if row and value == values[row - 1] else 1
        ends = row == len(values) - 1 or values[row + 1] != value
        if ends and run >= samples and value in {values.min(), values.max()} - {rest}:
            count += run
    assert count_saturated(values, samples, rest) == (0 if values.min() == values.max() else count)


@given(st.floats(-5, 5), st.floats(-5, 5), st.sets(st.integers(1, 18), max_size=8))
def test_absent_values_on_a_straight_line_come_back_exactly(slope, start, absent):
    time = np.arange(20.0)
    line = (start + slope * time)[:, None]
    holed = line.copy()
    holed[list(absent)] = np.nan
    np.testing.assert_allclose(fill(time, holed, time), line, atol=1e-9)


@given(st.floats(0.01, 100), st.floats(-100, 100), st.integers(0, 1000))
def test_spikes_do_not_depend_on_scale_and_offset(scale, offset, seed):
    values = np.random.default_rng(seed).standard_normal(60)
    values[30] += 50
    spikes = find_spikes(values, 8.0, 7)
    assert spikes[30]
    np.testing.assert_array_equal(find_spikes(scale * values + offset, 8.0, 7), spikes)


@given(st.floats(0.01, 0.2), st.floats(0, 6.2), st.floats(-3, 3), st.integers(3, 9))
def test_crests_of_a_resolved_oscillation_are_no_spikes(frequency, phase, slope, window):
    """Up to five samples to a period, on any slope, in any window: the turning points are motion."""
    sample = np.arange(200.0)
    wave = np.sin(2 * np.pi * frequency * sample + phase) + slope * sample
    assert not find_spikes(wave, 8.0, window).any()


@given(st.integers(0, 199), st.floats(20, 1e6), st.sampled_from([-1, 1]), st.integers(0, 100))
def test_one_large_spike_is_found_wherever_it_stands(row, size, sign, seed):
    values = np.random.default_rng(seed).uniform(-1, 1, 200)
    values[row] = sign * size
    np.testing.assert_array_equal(np.flatnonzero(find_spikes(values, 8.0, 7)), [row])
