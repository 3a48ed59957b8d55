import numpy as np
import pytest
from scipy.stats import rankdata

from cpfls_cli.evolution.archive import positions, rank

# a, b and c do not dominate one another; d is dominated by b; e by all four.
HAND_WORKED = np.array([[1.0, 4.0], [2.0, 2.0], [4.0, 1.0], [3.0, 3.0], [4.0, 4.0]])


@pytest.mark.parametrize("method", ["quantity-dominance", "pareto-count", "pareto-fronts"])
def test_a_failed_individual_ranks_last_and_failures_tie(method):
    failed = [[np.nan, np.nan], [np.inf, -np.inf], [np.nan, np.inf]]
    ranks = rank(np.vstack([HAND_WORKED, failed]), method)
    assert len(set(ranks[5:].tolist())) == 1
    assert ranks[5] > ranks[:5].max()


def test_a_weight_counts_the_first_objective_so_many_times():
    # first objective: smaller minus larger is -4 -2 3 0 3, ten times; second: 3 -2 -4 0 3
    assert rank(HAND_WORKED, "quantity-dominance", 10).tolist() == [-37, -22, 26, 0, 33]


@pytest.mark.parametrize("method", ["pareto-count", "pareto-fronts"])
def test_pareto_rankings_know_no_weight(method):
    np.testing.assert_array_equal(rank(HAND_WORKED, method, 10), rank(HAND_WORKED, method))


@pytest.mark.parametrize("values", [[3, 1, 2], [1, 1, 2, 1], [np.inf, 0.5, np.inf, -1.0, 0.5], [7]])
def test_positions_are_ranks_with_ties_averaged(values):
    np.testing.assert_array_equal(positions(np.array(values)), rankdata(values, method="average"))
