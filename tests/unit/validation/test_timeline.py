"""Samples in the order of time: blocks, how many, where, and what they hold of a selection; stretches and lags."""

import numpy as np
import pytest

from cpfls_cli.identification.data import Flights
from cpfls_cli.validation.residuals import (
    lagged_pairs,
    sample_numbers,
    sample_period,
    stretch_numbers,
    time_blocks,
)
from tests.builders.flights import still_flight


def blank_flight(samples):
    return still_flight(np.zeros((samples, 3)))


def test_a_fortieth_of_the_flight_unless_asked_otherwise():
    data = blank_flight(4000)
    blocks = time_blocks(data, None)
    assert blocks.duration == pytest.approx(1.0)
    np.testing.assert_array_equal(blocks.labels(data), np.arange(4000) // 100)


@pytest.mark.parametrize(("asked", "expected"), [(2.0, 20), (0.5, 80), (1e-3, 200), (1e6, 2)])
def test_blocks_of_a_duration(asked, expected):
    blocks = time_blocks(blank_flight(4000), asked)
    assert len(blocks.starts) + 1 == expected
    assert blocks.duration == pytest.approx(40.0 / expected)


def test_no_more_than_there_is_memory_for():
    assert len(time_blocks(blank_flight(4000), None, most=7).starts) == 6


@pytest.mark.parametrize(("samples", "expected"), [(400, 20), (100, 5), (30, 2), (2, 2), (1, 1)])
def test_a_short_flight_has_fewer(samples, expected):
    data = blank_flight(samples)
    label = time_blocks(data, None).labels(data)
    assert label[0] == 0
    assert label[-1] == expected - 1


def test_a_selection_counts_the_blocks_that_it_is_in():
    data = blank_flight(4000)
    blocks = time_blocks(data, None)
    learned = data[np.array([5, 7, 150, 151, 3999])]
    assert blocks.number(learned.time).tolist() == [0, 0, 1, 1, 39]
    assert blocks.labels(learned).tolist() == [0, 0, 1, 1, 2]


def test_the_pause_between_flights_counts_for_nothing():
    both = Flights((blank_flight(2000), blank_flight(2000)))
    blocks = time_blocks(both, None)
    assert blocks.duration == pytest.approx(1.0)
    np.testing.assert_array_equal(blocks.labels(both), np.arange(4000) // 100)


def test_a_pause_starts_a_stretch_and_jitter_does_not():
    time = np.arange(20) * 0.01 + np.random.default_rng(53).uniform(-0.002, 0.002, 20)
    time[12:] += 0.01
    np.testing.assert_array_equal(stretch_numbers(time), np.repeat([0, 1], [12, 8]))
    np.testing.assert_array_equal(stretch_numbers(time[:1]), [0])
    assert np.isnan(sample_period(time[:1]))


def test_a_slow_flight_and_a_fast_one_are_two_stretches():
    slow, fast = 0.01 * np.arange(300), 0.002 * np.arange(2000)
    for time in (np.r_[slow, 1e4 + fast], np.r_[fast, 1e4 + slow]):
        assert stretch_numbers(time)[-1] == 1
        assert sample_numbers(time, 8)[-1] == 2298 + 8
    np.testing.assert_array_equal(lagged_pairs(sample_numbers(slow[[0, 1, 3, 4]], 8), 2), [[1], [2]])
