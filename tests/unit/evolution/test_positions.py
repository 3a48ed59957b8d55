import numpy as np
import pytest
from scipy.stats import rankdata

from cpfls_cli.evolution.positions import positions


@pytest.mark.parametrize("values", [[3, 1, 2], [1, 1, 2, 1], [np.inf, 0.5, np.inf, -1.0, 0.5], [7]])
def test_positions_are_ranks_with_ties_averaged(values):
    np.testing.assert_array_equal(positions(np.array(values)), rankdata(values, method="average"))


def test_positions_of_many_values_with_ties():
    values = np.random.default_rng(1).integers(0, 50, 500)
    np.testing.assert_array_equal(positions(values), rankdata(values, method="average"))
