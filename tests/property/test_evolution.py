"""Operators and ranking of the evolution on any population."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from cpfls_cli.evolution.archive import pareto_front, rank
from cpfls_cli.evolution.engine import gray_decode, gray_encode, linear_ranking_fitness, stochastic_universal_sampling

RANKS = arrays(np.int64, st.integers(2, 40), elements=st.integers(-5, 5))


@given(st.data(), st.integers(1, 20))
def test_decoding_undoes_encoding(data, bits_per_gene):
    shape = data.draw(array_shapes(min_dims=2, max_dims=2, max_side=6))
    genes = data.draw(arrays(np.int64, shape, elements=st.integers(0, 2**bits_per_gene - 1)))
    bits = gray_encode(genes, bits_per_gene)
    assert bits.shape == (shape[0], shape[1] * bits_per_gene)
    np.testing.assert_array_equal(gray_decode(bits, bits_per_gene), genes)


@given(RANKS, st.floats(1, 2))
def test_fitness_has_mean_one_stays_in_bounds_and_follows_the_ranks(ranks, pressure):
    fitness = linear_ranking_fitness(ranks, pressure)
    np.testing.assert_allclose(fitness.mean(), 1.0)
    assert fitness.min() >= 2 - pressure - 1e-12
    assert fitness.max() <= pressure + 1e-12
    assert np.all(np.diff(fitness[np.argsort(ranks)]) <= 0)


@given(arrays(np.int64, st.integers(1, 30), elements=st.integers(0, 9)), st.integers(1, 60), st.integers(0, 99))
def test_each_individual_is_chosen_its_expectation_rounded_down_or_up(weights, count, seed):
    weights[0] += 1
    chosen = stochastic_universal_sampling(weights.astype(float), count, np.random.default_rng(seed))
    copies = np.bincount(chosen, minlength=len(weights))
    expectation = count * weights / weights.sum()
    # Rounding may move a pointer over the edge of a sector whose width is a whole number of spacings.
    assert len(chosen) == count
    assert np.all(copies >= np.floor(expectation - 1e-9))
    assert np.all(copies <= np.ceil(expectation + 1e-9))


# Few distinct values, so that ties, dominance and equal vectors are common.
VALUES = st.sampled_from([-1.0, 0.0, 0.5, 2.0, np.inf, -np.inf, np.nan])
OBJECTIVES = st.tuples(st.integers(1, 12), st.integers(1, 4)).flatmap(
    lambda shape: arrays(np.float64, shape, elements=VALUES)
)


def costs_of(objectives):
    return [[value if np.isfinite(value) else float("inf") for value in row] for row in objectives.tolist()]


def dominates(one, other):
    return all(a <= b for a, b in zip(one, other, strict=True)) and one != other


def brute_quantity_dominance(costs):
    better = [[sum(a < b for a, b in zip(j, i, strict=True)) for j in costs] for i in costs]
    n = range(len(costs))
    return [sum(better[i][j] - better[j][i] for j in n) for i in n]


def brute_pareto_count(costs):
    return [1 + sum(dominates(j, i) for j in costs) for i in costs]


def brute_pareto_fronts(costs):
    ranks, left, front = [0] * len(costs), set(range(len(costs))), 0
    while left:
        front += 1
        members = {i for i in left if not any(dominates(costs[j], costs[i]) for j in left)}
        for i in members:
            ranks[i] = front
        left -= members
    return ranks


BRUTE = {
    "quantity-dominance": brute_quantity_dominance,
    "pareto-count": brute_pareto_count,
    "pareto-fronts": brute_pareto_fronts,
}


@pytest.mark.parametrize("method", BRUTE)
@given(objectives=OBJECTIVES)
def test_ranks_are_those_of_the_definition(method, objectives):
    assert rank(objectives, method).tolist() == BRUTE[method](costs_of(objectives))


@given(OBJECTIVES)
def test_the_front_is_every_non_dominated_vector_once(objectives):
    costs, front = costs_of(objectives), pareto_front(objectives)
    expected = [
        i for i, one in enumerate(costs) if not any(dominates(other, one) for other in costs) and one not in costs[:i]
    ]
    assert front.tolist() == expected
