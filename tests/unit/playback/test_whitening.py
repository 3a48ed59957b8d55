"""Gusts and noise of a residual: innovations, their memory and size, and the parts that a model lacks."""

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.estimation.spectra import GaussMarkov
from cpfls_cli.playback.gusts import GUST_AXES, Gusts
from cpfls_cli.playback.innovations import ResidualInnovations, about_mean, before, predicted, whitening
from cpfls_cli.playback.lack import Lack, lack_of
from tests.builders.playback_flights import truth

KEPT = np.array([0.97, 0.99])
BLOCKS, WINDOWS = 24, 60
BLOCK = np.repeat(np.arange(BLOCKS), WINDOWS)
GUSTS = Gusts(np.array([1e-4, 2e-4, 0.0, 0.01, 0.02, 0.03]), np.array([0.3, 1.2, 1.0, 1.0, 0.1, 0.5]))
PIECES, FREQUENCIES, STEP_S = 800, 30, 0.02
KNOWN = np.linspace(2.0, 0.5, FREQUENCIES)
SHARE, REST, MEMORY_S = np.array([0.3, 0.1, 0.0]), 0.4, 0.5


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
    assert not innovations_of(np.zeros((len(BLOCK), 6)), moved=np.ones((len(BLOCK), 2))).grows(0.05).any()


def test_a_gust_has_its_size_and_falls_to_37_percent_within_its_memory():
    step, count = 0.02, 200_000
    drawn = GUSTS.drawn(np.random.default_rng(1), step, count)
    assert (drawn.shape, drawn.std(axis=0)) == ((count, len(GUST_AXES)), pytest.approx(GUSTS.size, rel=0.05))
    for column, size, memory in zip(drawn.T, GUSTS.size, GUSTS.memory, strict=True):
        late = round(memory / step)
        assert np.mean(column[late:] * column[:-late]) == pytest.approx(size**2 / np.e, rel=0.12)


def test_the_first_gust_is_as_large_as_any_and_comes_again_with_its_seed():
    rng = np.random.default_rng(2)
    first = np.array([GUSTS.drawn(rng, 0.01, 1)[0] for _ in range(4000)])
    assert first.std(axis=0) == pytest.approx(GUSTS.size, rel=0.05)
    one, other = (GUSTS.drawn(np.random.default_rng(3), 0.01, 50) for _ in range(2))
    np.testing.assert_array_equal(one, other)


def test_white_noise_grows_as_steps_get_shorter():
    white = Gusts(np.zeros(6), np.ones(6), np.array([1e-3, 0.0, 2e-3, 0.1, 0.2, 0.3]))
    for step in (0.01, 0.0025):
        drawn = white.drawn(np.random.default_rng(4), step, 20_000)
        assert drawn.std(axis=0) * np.sqrt(step) == pytest.approx(white.white, rel=0.03)
        assert np.abs(np.corrcoef(drawn[1:, 0], drawn[:-1, 0])[0, 1]) < 0.05


@pytest.fixture(scope="module")
def rest():
    """Spectra of a process seen through pieces of 4 s."""
    return GaussMarkov.seen_by(np.hanning(200) / np.sqrt(50), STEP_S, 2 * np.pi * 0.25 * np.arange(FREQUENCIES))


@pytest.fixture(scope="module")
def pieces(rest):
    """Power that is left where parts are of very different sizes on each piece, and the last of them nothing."""
    rng = np.random.default_rng(5)
    squares = rng.uniform(0.05, 8.0, (PIECES, 3)) ** 2 * [1.0, 9.0, 0.0]
    expected = KNOWN + (REST**2 + squares @ SHARE**2)[:, None] * rest.power(MEMORY_S)[0]
    return expected * rng.standard_exponential((PIECES, FREQUENCIES)), squares


def test_shares_the_rest_and_the_memory_are_found(pieces, rest):
    found = lack_of(*pieces, KNOWN, rest, (0.05, 8.0))
    assert (found.share[:2], found.share[2]) == (pytest.approx(SHARE[:2], rel=0.15), 0.0)
    assert found.rest < 3 * REST
    assert found.memory == pytest.approx(MEMORY_S, rel=0.15)


def test_the_unit_of_a_part_does_not_matter(pieces, rest):
    power, squares = pieces
    one, other = (
        lack_of(power, squares, KNOWN, rest, (0.05, 8.0)),
        lack_of(power, 1e-6 * squares, KNOWN, rest, (0.05, 8.0)),
    )
    assert 1e-3 * other.share == pytest.approx(one.share, rel=1e-3)


def test_where_nothing_is_lacking_little_is_found(pieces, rest):
    noise = KNOWN * np.random.default_rng(6).standard_exponential((PIECES, FREQUENCIES))
    found = lack_of(noise, pieces[1], KNOWN, rest, (0.05, 8.0))
    size = found.rest**2 + (pieces[1] @ found.share**2).mean()
    assert size * rest.power(found.memory)[0].mean() < 0.05 * KNOWN.mean()


def test_a_model_whose_parts_give_nothing_has_a_rest_alone(rest):
    rng = np.random.default_rng(7)
    power = (KNOWN + rest.power(MEMORY_S)[0]) * rng.standard_exponential((PIECES, FREQUENCIES))
    found = lack_of(power, np.zeros((PIECES, 2)), KNOWN, rest, (0.05, 8.0))
    assert found.rest == pytest.approx(1.0, rel=0.1)
    assert not found.share.any()


def test_it_is_played_as_large_as_the_parts_are_where_the_vehicle_flies():
    model, nothing = truth(), [np.nan] * 3
    share = np.array([[0.3, 0.1, 0.2], [0.0, 2.0, 0.4], [0.1, 0.0, 0.0], *[nothing] * 3])
    lack = Lack(
        tuple(one.name for one in model.parts)[:3],
        share,
        np.array([0.01, 0.02, 0.0, *nothing]),
        np.array([0.5, 0.1, 2, *nothing]),
    )
    drawn = lack.drawn(model, np.random.default_rng(1), 0.01, 4000)
    assert drawn.unit[:, :2].std(axis=0) == pytest.approx(1.0, abs=0.15)
    assert np.corrcoef(drawn.unit[:-1, 1], drawn.unit[1:, 1])[0, 1] == pytest.approx(np.exp(-0.1), abs=0.03)
    velocity, speed = np.array([2.0, -1.0, 0.5]), np.array([500.0, 600.0, 700.0, 800.0])
    # No part turns, and all rotors turn alike.
    alike = np.full(4, np.sqrt((speed**2).mean()))
    terms = np.concatenate([[1.0], alike, alike**2, np.zeros(8)])
    by_part = model.wrench_by_part(velocity[None], np.zeros((1, 3)), terms[None])
    parts = [by_part[name][0] for name in lack.part]
    size = np.sqrt(
        lack.rest[:3] ** 2 + sum((own * part[:3]) ** 2 for own, part in zip(share[:3].T, parts, strict=True))
    )
    turning = {name: (tuple(part[:3]), tuple(part[3:])) for name, part in zip(lack.part, parts, strict=True)}
    given = np.array(drawn.at(tuple(drawn.unit[7]), turning))
    assert given[:3] == pytest.approx(size * drawn.unit[7, :3], rel=1e-9)
    assert size[1] > 1.02 * lack.rest[1]
    assert not given[3:].any()
