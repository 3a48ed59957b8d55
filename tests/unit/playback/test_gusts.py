"""Gusts as random processes: their size, their memory, and that they come again with their generator."""

import numpy as np
import pytest

from cpfls_cli.playback.gusts import GUST_AXES, Gusts

GUSTS = Gusts(np.array([1e-4, 2e-4, 0.0, 0.01, 0.02, 0.03]), np.array([0.3, 1.2, 1.0, 1.0, 0.1, 0.5]))


def test_a_gust_has_its_size_and_falls_to_37_percent_within_its_memory():
    step, count = 0.02, 200_000
    drawn = GUSTS.drawn(np.random.default_rng(1), step, count)
    assert drawn.shape == (count, len(GUST_AXES))
    assert drawn.std(axis=0) == pytest.approx(GUSTS.size, rel=0.05)
    for column, size, memory in zip(drawn.T, GUSTS.size, GUSTS.memory, strict=True):
        late = round(memory / step)
        assert np.mean(column[late:] * column[:-late]) == pytest.approx(size**2 / np.e, rel=0.12)


def test_the_first_is_as_large_as_any():
    rng = np.random.default_rng(2)
    first = np.array([GUSTS.drawn(rng, 0.01, 1)[0] for _ in range(4000)])
    assert first.std(axis=0) == pytest.approx(GUSTS.size, rel=0.05)


def test_gusts_come_again_with_their_seed():
    one, other = (GUSTS.drawn(np.random.default_rng(3), 0.01, 50) for _ in range(2))
    np.testing.assert_array_equal(one, other)


def test_white_noise_grows_as_steps_get_shorter():
    white = Gusts(np.zeros(6), np.ones(6), np.array([1e-3, 0.0, 2e-3, 0.1, 0.2, 0.3]))
    for step in (0.01, 0.0025):
        drawn = white.drawn(np.random.default_rng(4), step, 20_000)
        assert drawn.std(axis=0) * np.sqrt(step) == pytest.approx(white.white, rel=0.03)
        assert np.abs(np.corrcoef(drawn[1:, 0], drawn[:-1, 0])[0, 1]) < 0.05
