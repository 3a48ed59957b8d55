"""How explanations are compared."""

import numpy as np
import pytest
from scipy.stats import permutation_test, wilcoxon

from cpfls_cli.gap.naming.odds import chance_of_ranks, likely, off_by


@pytest.mark.parametrize("blocks", [1, 2, 7, 40])
@pytest.mark.parametrize("mean", [-0.5, 0.0, 0.5])
def test_the_chance_of_ranks_is_that_of_scipy(blocks, mean):
    margin = np.random.default_rng(blocks).standard_normal(blocks) + mean
    expected = wilcoxon(margin, alternative="greater", method="exact").pvalue
    assert chance_of_ranks(np.append(margin, 0.0)) == pytest.approx(expected, rel=1e-12)


def test_equal_margins_share_their_ranks():
    margin = np.array([1.0, -1.0, 2.0, 2.0, 2.0, -0.5, 3.0, 1.0])
    ranks = np.array([3.0, 3.0, 6.0, 6.0, 6.0, 1.0, 8.0, 3.0]) * np.sign(margin)
    above = lambda each: each[each > 0].sum()  # noqa: E731
    exact = permutation_test((ranks,), above, permutation_type="samples", alternative="greater")
    assert chance_of_ranks(margin) == pytest.approx(exact.pvalue, rel=1e-12)


def test_what_is_equal_is_chance():
    assert chance_of_ranks(np.zeros(4)) == 1.0


@pytest.mark.parametrize(
    ("explained", "left", "above", "off"),
    [(1e3, 600.0, 0.0, 10.0), (1e6, 600.0, 0.0, 25.0), (1e6, 1200.0, 600.0, 650.0), (1e4, 1200.0, 600.0, 100.0)],
    ids=["a tenth of a small gap", "what the floor hides", "what is left above it", "a tenth is the most"],
)
def test_formulas_are_off_by_what_is_left_above_the_floor_and_a_tenth_at_most(explained, left, above, off):
    assert off_by(explained, left, above) == pytest.approx(off)


def test_alone_a_set_is_certain():
    assert likely([]).tolist() == [1.0]


def test_what_predicts_every_block_alike_is_as_likely():
    assert likely([np.zeros(12), np.zeros(12)]) == pytest.approx([1 / 3] * 3)


def test_even_odds_of_blocks_multiply():
    """Where all blocks say the same their weights do not matter: Bayes' rule remains."""
    odds = np.log([1 / 4, 1 / 19])
    assert likely([np.full(12, each / 12) for each in odds]) == pytest.approx(
        [1 / 1.302632, 0.25 / 1.302632, 0.052632 / 1.302632], abs=1e-5
    )


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_one_block_makes_nothing_certain(sign):
    """However much it says: were it left out, nothing would be known."""
    (own, other) = likely([np.r_[sign * 40.0, np.zeros(11)]])
    assert 0.005 < min(own, other) < 0.1
    assert (other > own) == (sign > 0)
