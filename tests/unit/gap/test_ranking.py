"""How explanations are compared."""

import numpy as np
import pytest
from scipy.stats import permutation_test, wilcoxon

from cpfls_cli.gap.naming.ranking import chance_of_ranks


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
