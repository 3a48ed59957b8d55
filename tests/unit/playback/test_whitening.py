"""Innovations of a disturbance that lasts, with noise that is differentiated: white, and nothing that was before."""

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.playback.innovations import about_mean, before, predicted, whitening

KEPT = np.array([0.97, 0.99])


def white_of(found, rows):
    return np.stack([found.white(rows[:, channel], channel) for channel in range(2)], axis=1)


@pytest.fixture(scope="module")
def residual():
    """Two runs of two channels: a Gauss-Markov process, and the derivative of noise as large as it."""
    rng = np.random.default_rng(5)
    runs = []
    for _ in range(2):
        drawn = rng.standard_normal((40000, 2)) * np.sqrt(1 - KEPT**2)
        gusts = np.stack([lfilter([1.0], [1.0, -kept], own) for kept, own in zip(KEPT, drawn.T, strict=True)], axis=1)
        runs.append(gusts + np.diff(rng.standard_normal((40001, 2)), axis=0))
    return runs


def test_what_lasts_is_found_below_noise_that_is_differentiated(residual):
    assert np.allclose(whitening(residual, np.ones(2, dtype=bool)).kept, KEPT, atol=0.002)


def test_innovations_are_white_and_correlate_with_nothing_before(residual):
    found = whitening(residual, np.ones(2, dtype=bool))
    for rows in residual:
        new = white_of(found, rows)
        assert np.allclose(new.std(axis=0), 1.0, atol=0.03)
        error = 1 / np.sqrt(len(new))
        for lag in (1, 2, 5, 20):
            assert (np.abs((new[lag:] * new[:-lag]).mean(axis=0)) < 4 * error).all()
        past = before(rows)
        past = past / past.std(axis=0)
        assert (np.abs((new[..., None] * past).mean(axis=0)) < 4 * error).all()


def test_channels_that_are_left_out_weigh_nothing(residual):
    found = whitening(residual, np.array([True, False]))
    assert np.isinf(found.scale[1])
    assert not found.white(residual[0][:, 1], 1).any()


@pytest.mark.parametrize("count", [10, 60, 85, 90])
def test_what_has_no_past_or_nothing_ahead_is_left_out(residual, count):
    found = whitening(residual, np.ones(2, dtype=bool))
    new, past = white_of(found, residual[0][:count]), before(residual[0][:count])
    assert len(new) == len(past) == max(0, count - 85)


def test_columns_are_predicted_by_the_other_runs():
    rng = np.random.default_rng(6)
    motion, columns = ([rng.standard_normal((600, 2)) for _ in range(2)] for _ in range(2))
    past = [
        (before(moved).sum(axis=(1, 2))[:, None], before(own).sum(axis=2))
        for moved, own in zip(motion, columns, strict=True)
    ]
    values = [of_motion * weight + own / weight for (of_motion, own), weight in zip(past, (2.0, -1.0), strict=True)]
    found = predicted(motion, columns, values)
    # What the one shows is said of the other.
    for known, (of_motion, own), weight in zip(found, past, (-1.0, 2.0), strict=True):
        assert np.allclose(known, about_mean(of_motion * weight + own / weight), atol=1e-3)
    (alone,) = predicted(motion[:1], columns[:1], values[:1])
    assert np.allclose(alone, about_mean(values[0]), atol=1e-3)


def test_a_fierce_run_is_predicted_by_gentle_ones():
    rng = np.random.default_rng(8)
    sizes, motion = (1.0, 1e-3, 1e-3), rng.standard_normal((3, 600, 1))
    columns = [size * rng.standard_normal((600, 1)) for size in sizes]
    values = [before(own).sum(axis=2) for own in columns]
    fierce, *_ = predicted(list(motion), columns, values)
    assert np.allclose(fierce, about_mean(values[0]), atol=1e-3)


def test_no_part_of_a_single_run_is_predicted_by_itself():
    rng = np.random.default_rng(7)
    motion, columns = rng.standard_normal((2, 1085, 2))
    values = rng.standard_normal((1000, 2))
    other = values + np.repeat([0.0, 1.0, 0.0], [400, 200, 400])[:, None] * rng.standard_normal((1000, 2))
    known, without = (predicted([motion], [columns], [each])[0][400:600] for each in (values, other))
    # Both are about the mean of the run.
    assert np.allclose(known - known.mean(axis=0), without - without.mean(axis=0))


def test_a_mean_is_taken_off_and_a_constant_leaves_nothing(residual):
    rows = np.column_stack([residual[0] + 5.0, np.full(len(residual[0]), 0.1)])
    about = about_mean(rows)
    assert np.allclose(about[:, :2], residual[0] - residual[0].mean(axis=0))
    # Not even rounding, which a test of its size would divide by.
    assert not about[:, 2].any()
    assert about_mean(rows[:0]).shape == (0, 3)
