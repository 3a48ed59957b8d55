"""The spread of replicates beside the standard library's, and which run is the best."""

import statistics

import numpy as np
import pytest

from benchmarks.paper.replicates import spread
from cpfls_cli.result import plain
from tests.builders.sweeps import setting_of

VALUES = [0.0012, 0.0009, 0.0031, 0.0010]


def test_mean_and_variance():
    found = spread(np.array(VALUES))
    assert found.count == len(VALUES)
    assert found.mean == pytest.approx(statistics.mean(VALUES))
    assert found.variance == pytest.approx(statistics.variance(VALUES))
    assert found.standard_deviation == pytest.approx(statistics.stdev(VALUES))


def test_what_is_not_known_does_not_count():
    assert plain(spread(np.array([*VALUES, np.nan, np.inf]))) == plain(spread(np.array(VALUES)))


def test_too_few():
    one, none = spread(np.array([3.0])), spread(np.array([]))
    assert (one.count, one.mean) == (1, 3.0)
    assert np.isnan([one.variance, one.standard_deviation, none.mean, none.variance]).all()


def test_best_run():
    assert setting_of((3.0, np.nan, 1.0)).best.seed == 2
    assert setting_of((np.nan,)).best is None
