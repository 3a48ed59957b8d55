"""What a model lacks: shares by which its parts are off, found in power of what is left, piece by piece."""

import numpy as np
import pytest

from cpfls_cli.playback.lack import Rest, _Likelihood, lack_of

PIECES, FREQUENCIES, STEP_S = 600, 30, 0.02
SHARE = np.array([[0.09, 0.06, 0.0], [0.06, 0.05, 0.0], [0.0, 0.0, 0.0]])
KNOWN = np.linspace(2.0, 0.5, FREQUENCIES)
SIZE, MEMORY_S = 0.6, 0.5


@pytest.fixture(scope="module")
def rest():
    """Spectra of a process seen through pieces of 4 s."""
    lags = STEP_S * np.arange(200)
    turns = 2 * np.pi * 0.25 * np.arange(FREQUENCIES)
    window = np.hanning(200)
    alike = np.correlate(window, window, "full")[199:]
    return Rest(np.cos(np.outer(turns, lags)) * alike * np.where(lags == 0, 1.0, 2.0) / 50, lags, (0.05, 8.0))


@pytest.fixture(scope="module")
def pieces(rest):
    """Parts of very different sizes, the last of them nothing, and the power that they and the rest leave."""
    rng = np.random.default_rng(5)

    def normal(*shape):
        return rng.standard_normal((*shape, 2)) @ [1, 1j] / np.sqrt(2)

    parts = normal(PIECES, 3, FREQUENCIES) * (rng.uniform(0.3, 3.0, PIECES)[:, None] * [10.0, 30.0, 0.0])[:, :, None]
    off = rng.multivariate_normal(np.zeros(3), SHARE, PIECES)
    beside = np.sqrt(KNOWN + SIZE**2 * rest.power(MEMORY_S)[0]) * normal(PIECES, FREQUENCIES)
    return np.abs(np.einsum("pk,pkf->pf", off, parts) + beside) ** 2, parts


def test_shares_and_what_goes_together_are_found(pieces, rest):
    found = lack_of(*pieces, KNOWN, rest)
    assert found.share == pytest.approx(SHARE, abs=0.008)
    assert found.size == pytest.approx(SIZE, rel=0.15)
    assert found.memory == pytest.approx(MEMORY_S, rel=0.5)


def test_the_unit_of_a_part_does_not_matter(pieces, rest):
    power, parts = pieces
    one, other = lack_of(power, parts, KNOWN, rest), lack_of(power, 1e-3 * parts, KNOWN, rest)
    assert 1e-6 * other.share == pytest.approx(one.share, rel=1e-3, abs=1e-6)


def test_where_nothing_is_lacking_little_is_found(pieces, rest):
    rng = np.random.default_rng(6)
    noise = KNOWN * rng.standard_exponential((PIECES, FREQUENCIES))
    found = lack_of(noise, pieces[1], KNOWN, rest)
    of_parts = np.einsum("pif,ij,pjf->pf", np.conj(pieces[1]), found.share, pieces[1]).real
    assert of_parts.mean() + found.size**2 * rest.power(found.memory)[0].mean() < 0.05 * KNOWN.mean()


def test_slopes_are_those_of_the_likelihood(pieces, rest):
    power, parts = pieces
    likelihood = _Likelihood(power, parts[:, :2] / 20, KNOWN, rest)
    at = np.array([0.4, 0.2, 0.3, 0.5, -1.0])
    _, slopes = likelihood(at)
    step = 1e-5
    each = [(likelihood(at + move)[0] - likelihood(at - move)[0]) / (2 * step) for move in step * np.eye(5)]
    assert slopes == pytest.approx(each, rel=1e-5, abs=1e-6)
