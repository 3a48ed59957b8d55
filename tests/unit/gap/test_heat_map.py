"""Means over cells against scipy's."""

import numpy as np
from scipy.stats import binned_statistic_2d

from cpfls_cli.gap.residual.heat_map import heat_map


def test_cells_hold_the_mean_and_count_every_known_window():
    rng = np.random.default_rng(0)
    first, second, residual = rng.standard_normal((3, 500))
    second[::50] = np.nan
    found = heat_map(residual, first, second, bins=6)
    known = np.isfinite(second)
    inside = [np.clip(s[known], e[0], e[-1]) for s, e in zip((first, second), found.edges, strict=True)]
    expected = binned_statistic_2d(*inside, residual[known], "mean", bins=list(found.edges)).statistic
    np.testing.assert_allclose(found.mean, expected)
    assert found.count.sum() == known.sum()


def test_a_signal_that_stands_still_has_one_filled_column():
    found = heat_map(np.arange(4.0), np.ones(4), np.arange(4.0), bins=3)
    assert (found.count.sum(axis=1) > 0).sum() == 1
    assert np.isnan(found.mean).any()


def test_no_windows_leave_the_map_empty():
    found = heat_map(np.zeros(3), np.full(3, np.nan), np.zeros(3))
    assert found.count.sum() == 0
