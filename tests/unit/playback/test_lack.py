"""What a model lacks: shares of its parts and a rest, found in power of what is left, piece by piece."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.estimation.whittle import GaussMarkov
from cpfls_cli.playback.lack import Lack, lack_of
from tests.builders.playback_flights import truth

PIECES, FREQUENCIES, STEP_S = 800, 30, 0.02
KNOWN = np.linspace(2.0, 0.5, FREQUENCIES)
SHARE, REST, MEMORY_S = np.array([0.3, 0.1, 0.0]), 0.4, 0.5


@pytest.fixture(scope="module")
def rest():
    """Spectra of a process seen through pieces of 4 s."""
    return GaussMarkov.seen_by(np.hanning(200) / np.sqrt(50), STEP_S, 2 * np.pi * 0.25 * np.arange(FREQUENCIES))


@pytest.fixture(scope="module")
def pieces(rest):
    """Power that is left where parts are of very different sizes on each piece, and the last of them nothing."""
    rng = np.random.default_rng(5)
    squares = rng.uniform(0.05, 8.0, (PIECES, 3)) ** 2 * [1.0, 9.0, 0.0]
    size = REST**2 + squares @ SHARE**2
    expected = KNOWN + size[:, None] * rest.power(MEMORY_S)[0]
    return expected * rng.standard_exponential((PIECES, FREQUENCIES)), squares


def test_shares_the_rest_and_the_memory_are_found(pieces, rest):
    found = lack_of(*pieces, KNOWN, rest, (0.05, 8.0))
    assert found.share[:2] == pytest.approx(SHARE[:2], rel=0.15)
    assert found.share[2] == 0.0
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
    lack = Lack(tuple(model.parts)[:3], share, np.array([0.01, 0.02, 0.0, *nothing]), np.array([0.5, 0.1, 2, *nothing]))
    drawn = lack.drawn(model, np.random.default_rng(1), 0.01, 4000)
    assert drawn.unit[:, :2].std(axis=0) == pytest.approx(1.0, abs=0.15)
    assert np.corrcoef(drawn.unit[:-1, 1], drawn.unit[1:, 1])[0, 1] == pytest.approx(np.exp(-0.1), abs=0.03)
    velocity, speed = np.array([2.0, -1.0, 0.5]), np.array([500.0, 600.0, 700.0, 800.0])
    # No part turns, and all rotors turn alike.
    alike = np.full(4, np.sqrt((speed**2).mean()))
    terms = np.concatenate([[1.0], alike, alike**2, np.zeros(8)])
    still = np.zeros((1, 3))
    parts = [
        replace(model.table, weights=model.parts[name]).wrench(velocity[None], still, terms[None])[0]
        for name in lack.part
    ]
    size = np.sqrt(
        lack.rest[:3] ** 2 + sum((own * part[:3]) ** 2 for own, part in zip(share[:3].T, parts, strict=True))
    )
    turning = {name: (tuple(part[:3]), tuple(part[3:])) for name, part in zip(lack.part, parts, strict=True)}
    given = np.array(drawn.at(tuple(drawn.unit[7]), turning))
    assert given[:3] == pytest.approx(size * drawn.unit[7, :3], rel=1e-9)
    assert size[1] > 1.02 * lack.rest[1]
    assert not given[3:].any()
