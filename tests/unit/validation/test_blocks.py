"""Blocks of time: how many, where, and what they hold of a selection."""

import numpy as np
import pytest

from cpfls_cli.identification.data import Flights, TorqueData
from cpfls_cli.regressor import Motion
from cpfls_cli.validation.blocks import time_blocks


def flight(samples, step=0.01):
    still = np.zeros((samples, 3))
    return TorqueData(step * np.arange(samples), Motion(still, still, still), still)


def test_a_fortieth_of_the_flight_unless_asked_otherwise():
    data = flight(4000)
    blocks = time_blocks(data, None)
    assert blocks.duration == pytest.approx(1.0)
    np.testing.assert_array_equal(blocks.labels(data), np.arange(4000) // 100)


@pytest.mark.parametrize(("asked", "expected"), [(2.0, 20), (0.5, 80), (1e-3, 200), (1e6, 2)])
def test_blocks_of_a_duration(asked, expected):
    blocks = time_blocks(flight(4000), asked)
    assert len(blocks.starts) + 1 == expected
    assert blocks.duration == pytest.approx(40.0 / expected)


def test_no_more_than_there_is_memory_for():
    assert len(time_blocks(flight(4000), None, most=7).starts) == 6


@pytest.mark.parametrize(("samples", "expected"), [(400, 20), (100, 5), (30, 2), (2, 2), (1, 1)])
def test_a_short_flight_has_fewer(samples, expected):
    data = flight(samples)
    label = time_blocks(data, None).labels(data)
    assert label[0] == 0
    assert label[-1] == expected - 1


def test_a_selection_counts_the_blocks_that_it_is_in():
    data = flight(4000)
    blocks = time_blocks(data, None)
    learned = data[np.array([5, 7, 150, 151, 3999])]
    assert blocks.number(learned.time).tolist() == [0, 0, 1, 1, 39]
    assert blocks.labels(learned).tolist() == [0, 0, 1, 1, 2]


def test_the_pause_between_flights_counts_for_nothing():
    both = Flights((flight(2000), flight(2000)))
    blocks = time_blocks(both, None)
    assert blocks.duration == pytest.approx(1.0)
    np.testing.assert_array_equal(blocks.labels(both), np.arange(4000) // 100)
