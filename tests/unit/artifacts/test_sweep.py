"""The spread of replicates beside the standard library's, and which run is the best."""

import statistics

import numpy as np
import pytest

from cpfls_cli.artifacts.sweep import SettingRuns, spread

VALUES = [0.0012, 0.0009, 0.0031, 0.0010]


def test_mean_and_variance():
    found = spread(np.array(VALUES))
    assert found.count == len(VALUES)
    assert found.mean == pytest.approx(statistics.mean(VALUES))
    assert found.variance == pytest.approx(statistics.variance(VALUES))
    assert found.deviation == pytest.approx(statistics.stdev(VALUES))


def test_what_is_not_known_does_not_count():
    assert spread(np.array([*VALUES, np.nan, np.inf])) == spread(np.array(VALUES))


def test_too_few():
    one, none = spread(np.array([3.0])), spread(np.array([]))
    assert (one.count, one.mean) == (1, 3.0)
    assert np.isnan([one.variance, one.deviation, none.mean, none.variance]).all()


def runs_of(mse):
    runs, errors = np.arange(len(mse)), np.array(mse)[:, None]
    return SettingRuns("x", "cpfls", "D", 685, 500, 200, runs, runs, errors, errors, errors, runs)


def test_best_run():
    assert runs_of((3.0, np.nan, 1.0)).best == 2
    assert runs_of((3.0, np.nan, 1.0)).best_of(np.array([7.0, 8.0, 9.0])) == 9.0
    assert runs_of((np.nan,)).best is None
    assert np.isnan(runs_of((np.nan,)).best_of(np.array([7.0])))
