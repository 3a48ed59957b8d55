"""Readers of public flights: the numbers that are published come out of them."""

import os
from pathlib import Path

import numpy as np
import pytest

from benchmarks.shared import nanodrone_files, neurobem_files
from benchmarks.shared.playback_scores import as_published, nothing_moves, score


def data_of(variable):
    """Give the folder that a variable names, or skip the test."""
    if variable not in os.environ:
        pytest.skip(f"{variable} does not name the folder of the public flights")
    return Path(os.environ[variable])


def test_nothing_moves_on_the_real_test_flights_as_published():
    test = nanodrone_files.flights(data_of("CPFLS_NANODRONE"), nanodrone_files.TEST)
    runs = [nothing_moves(flight) for flight in test]
    within, published = score(runs), score(as_published(test, runs))
    assert within.windows == 19350
    assert within.mae[[0, 9, 49], 3] == pytest.approx([0.0796, 0.3588, 0.8777], abs=5e-5)
    assert within.sums[3] == pytest.approx(28.98, abs=5e-3)
    # Three windows less are published, which says nothing of which.
    assert published.mae[[0, 9, 49], 3] == pytest.approx([0.0796, 0.3596, 0.8837], abs=1e-4)
    assert published.sums == pytest.approx([17.7878, 38.9241, 8.2138, 29.0866], rel=3e-4)


def test_our_steps_give_the_published_square_flight():
    folder, name = data_of("CPFLS_NANODRONE"), "square_20251017_run3"
    published = nanodrone_files.flight(folder, name)
    columns = (nanodrone_files.columns(folder, file) for file in (name, "square_20251017"))
    ours = nanodrone_files.prepared(name, *columns)
    for signal in ("position", "velocity", "rotation", "rate"):
        assert getattr(ours.motion, signal) == pytest.approx(getattr(published.motion, signal), abs=1e-12)
    assert ours.speed == pytest.approx(published.speed, abs=1e-9)


def test_the_real_segments_fly_as_their_columns_say():
    found = neurobem_files.segments(data_of("CPFLS_NEUROBEM"))
    assert [len(segment.flight) for segment in found] == [3577, 3181, 2613, 2938, 2858, 2350]
    for segment in found:
        motion = segment.flight.motion
        moved = np.diff(motion.position, axis=0) / motion.period
        assert np.abs(moved - 0.5 * (motion.velocity[1:] + motion.velocity[:-1])).mean() < 0.05
        assert np.sqrt(np.mean((segment.wrench - segment.hybrid)[:, 5] ** 2)) < 0.08 * segment.wrench[:, 5].mean()
