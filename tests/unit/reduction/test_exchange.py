"""Selection by exchange against all subsets, against the greedy rules, and under its limits."""

from itertools import combinations

import numpy as np
import pytest

from cpfls_cli.reduction.settings import ReductionSettings
from tests.builders.reductions import reduce


def problem(seed, samples=40, columns=8):
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((samples, 3, columns)) * rng.uniform(0.3, 2.0, (samples, 1, 1))
    return rows * np.geomspace(1.0, 0.02, columns)


def condition_number(Q, indices):
    return np.linalg.cond(Q[list(indices)].reshape(-1, Q.shape[2]))


def compound(Q, indices):
    """The criterion in the limit of a high power, from its definition."""
    values = np.linalg.svd(Q[list(indices)].reshape(-1, Q.shape[2]), compute_uv=False)
    return 2 * np.log(values[0] / values[-1]) - 2.0 * np.mean(2 * np.log(values))


def exchanged(Q, size, criterion="K-exchange", **limits):
    return reduce(Q, ReductionSettings(criterion=criterion, size=size, **limits))


@pytest.mark.parametrize("seed", range(6))
def test_close_to_the_best_of_all_subsets(seed):
    Q = problem(seed, samples=14, columns=5)
    every = [condition_number(Q, subset) for subset in combinations(range(14), 5)]
    found = exchanged(Q, 5).condition_number
    assert found <= np.quantile(every, 0.01)
    assert found <= 1.15 * min(every)


@pytest.mark.parametrize("seed", range(4))
def test_information_counts_where_it_is_asked_for(seed):
    Q = problem(seed, samples=14, columns=5)
    every = [compound(Q, subset) for subset in combinations(range(14), 5)]
    assert compound(Q, exchanged(Q, 5, "KD-exchange").indices) <= np.quantile(every, 0.01)


@pytest.mark.parametrize("seed", range(4))
def test_better_conditioned_than_any_greedy_choice(seed):
    Q = problem(seed, samples=200)
    greedy = [
        reduce(Q, ReductionSettings(criterion=rule, size=30)).condition_number for rule in ("sigma_min", "A", "D")
    ]
    selection = exchanged(Q, 30)
    assert selection.exchanges > 0
    assert selection.condition_number == pytest.approx(condition_number(Q, selection.indices), rel=1e-9)
    assert selection.condition_number < 0.9 * min(greedy)


def test_keeping_information_predicts_better():
    """A condition number is also lowered by dropping the samples that say most; predictions pay for that."""
    Q = problem(1, samples=300)

    def worst_variance(selection):
        kept = Q[selection.indices].reshape(-1, 8)
        return np.einsum("nij,jk,nik->ni", Q, np.linalg.inv(kept.T @ kept), Q).max()

    assert worst_variance(exchanged(Q, 40, "KD-exchange")) < 0.5 * worst_variance(exchanged(Q, 40))


@pytest.mark.parametrize("criterion", ["K-exchange", "KD-exchange"])
def test_stops_at_the_first_size_that_reaches_the_target(criterion):
    Q = problem(2, samples=200)
    target = 1.1 * exchanged(Q, 24, criterion).condition_number
    selection = exchanged(Q, None, criterion, condition_number=target)
    assert selection.stop_reason == "condition-number"
    assert selection.condition_number <= target
    assert np.all(selection.condition_number_trace[:-1] > target)
    assert len(selection.indices) <= 30


def test_a_target_out_of_reach_of_the_size_ends_at_the_size():
    selection = exchanged(problem(2), 12, condition_number=1.001)
    assert (selection.stop_reason, len(selection.indices)) == ("size", 12)


@pytest.mark.parametrize("size", [3, 40])
def test_the_smallest_and_the_largest_set(size):
    selection = exchanged(problem(3), size)
    assert (selection.rank, len(set(selection.indices.tolist()))) == (8, size)


def test_badly_scaled_samples_are_exchanged_without_squaring_the_condition_number():
    rng = np.random.default_rng(0)
    Q = rng.standard_normal((80, 3, 6)) * np.geomspace(1.0, 1e-8, 6)
    selection = exchanged(Q, 20)
    greedy = reduce(Q, ReductionSettings(criterion="sigma_min", size=20))
    assert selection.rank == 6
    assert selection.exchanges > 0
    assert selection.condition_number < greedy.condition_number


def test_one_parameter_has_nothing_to_exchange():
    Q = np.random.default_rng(0).standard_normal((20, 3, 1))
    assert exchanged(Q, 5).condition_number == pytest.approx(1.0)
