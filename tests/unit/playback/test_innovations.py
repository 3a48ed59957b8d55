"""Innovations of a residual: their share that the past predicts, with noise; and whether they grow with the motion."""

import numpy as np
import pytest

from cpfls_cli.playback.innovations import ResidualInnovations

BLOCKS, WINDOWS = 24, 60
BLOCK = np.repeat(np.arange(BLOCKS), WINDOWS)


def innovations_of(new, *, predicted=None, noise=0.0, moved=None):
    nothing = np.zeros((len(BLOCK), 6))
    return ResidualInnovations(
        new,
        nothing if predicted is None else predicted,
        np.full(6, noise),
        nothing[:, :1] if moved is None else moved,
        BLOCK,
    )


def test_noise_that_nothing_predicts_is_no_part_of_innovations():
    signal, noise = np.random.default_rng(1).standard_normal((2, len(BLOCK), 6))
    share, without = innovations_of(signal + noise, predicted=0.5 * signal, noise=1.0).shares
    assert share == pytest.approx(0.5, abs=0.1)
    assert without.shape == (BLOCKS, 6)
    assert np.isnan(innovations_of(noise, noise=2.0).shares[0]).all()


def test_a_gust_does_not_grow_with_what_was_before_and_an_effect_does():
    rng = np.random.default_rng(2)
    # Gentle and fierce in turn, and by chance.
    fierce = 1.0 + 3 * (np.sin(np.arange(len(BLOCK)) / 5) > 0)
    moved = fierce * np.abs(rng.standard_normal(len(BLOCK)))
    new = rng.standard_normal((len(BLOCK), 6))
    new[:, 1] *= fierce
    new[:, 2] /= fierce
    found = innovations_of(new, moved=np.stack([moved, rng.standard_normal(len(BLOCK))], axis=1))
    assert found.grows(0.01).tolist() == [False, True, True, False, False, False]


def test_what_stands_still_grows_with_nothing():
    found = innovations_of(np.zeros((len(BLOCK), 6)), moved=np.ones((len(BLOCK), 2)))
    assert not found.grows(0.05).any()
