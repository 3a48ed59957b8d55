"""Views of a residual: stretches of time, means over two signals, correlation over lags."""

import numpy as np
import pytest
from scipy.stats import binned_statistic_2d

from cpfls_cli.gap.residual.views import heat_map, stretches

HOP = 0.2
CENTRES = np.tile(0.3 + HOP * np.arange(200), 2)
FLIGHT_INDEX = np.repeat([0, 1], 200)


def quiet():
    return np.random.default_rng(0).standard_normal((400, 6))


def test_a_burst_is_one_stretch_with_its_flight_and_times():
    residual = quiet()
    swing = 8 * (-1.0) ** np.arange(20)
    residual[260:280, 2] += swing
    (found,) = stretches(residual, CENTRES, FLIGHT_INDEX)
    assert (found.flight, found.channel) == (1, "torque z")
    assert found.start_s == pytest.approx(CENTRES[260], abs=3 * HOP)
    assert found.end_s == pytest.approx(CENTRES[279], abs=3 * HOP)
    assert 6 < found.rms_floors < 9


def test_a_short_pause_joins_and_a_long_one_does_not():
    residual = quiet()
    residual[[*range(20, 30), *range(35, 45), *range(150, 160)], 0] += 9
    found = sorted(stretches(residual, CENTRES, FLIGHT_INDEX), key=lambda one: one.start_s)
    assert len(found) == 2
    assert found[0].end_s - found[0].start_s > 25 * HOP - 2 * HOP


def test_noise_alone_has_no_stretch_and_many_bursts_are_cut_to_the_largest():
    assert stretches(quiet(), CENTRES, FLIGHT_INDEX) == ()
    residual = quiet()
    for number in range(8):
        residual[20 + 45 * number : 24 + 45 * number, 4] += 10 + number
    found = stretches(residual, CENTRES, FLIGHT_INDEX, most=3)
    assert len(found) == 3
    assert found[0].rms_floors >= found[-1].rms_floors
    assert {one.channel for one in found} == {"force y"}


def test_cells_hold_the_mean_and_count_every_known_window():
    first, second, residual = np.random.default_rng(0).standard_normal((3, 500))
    second[::50] = np.nan
    found = heat_map("torque x", residual, ("first", "second"), {"first": first, "second": second}, bins=6)
    edges = (found.first_edge, found.second_edge)
    known = np.isfinite(second)
    inside = [np.clip(s[known], e[0], e[-1]) for s, e in zip((first, second), edges, strict=True)]
    expected = binned_statistic_2d(*inside, residual[known], "mean", bins=list(edges)).statistic
    np.testing.assert_allclose(found.mean, expected)
    assert found.count.sum() == known.sum()


def test_a_signal_that_stands_still_has_one_filled_column():
    found = heat_map(
        "torque x", np.arange(4.0), ("still", "moves"), {"still": np.ones(4), "moves": np.arange(4.0)}, bins=3
    )
    assert (found.count.sum(axis=1) > 0).sum() == 1
    assert np.isnan(found.mean).any()


def test_no_windows_leave_the_map_empty():
    found = heat_map("torque x", np.zeros(3), ("a", "b"), {"a": np.full(3, np.nan), "b": np.zeros(3)})
    assert found.count.sum() == 0
