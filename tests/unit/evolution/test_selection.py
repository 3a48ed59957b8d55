import numpy as np

from cpfls_cli.evolution.selection import linear_ranking_fitness, stochastic_universal_sampling


def test_fitness_falls_linearly_from_the_pressure_to_its_complement():
    np.testing.assert_allclose(linear_ranking_fitness(np.array([30, 10, 50, 20, 40]), 1.5), [1.0, 1.5, 0.5, 1.25, 0.75])


def test_equal_ranks_share_the_mean_fitness():
    np.testing.assert_allclose(linear_ranking_fitness(np.array([1, 1, 1, 2]), 2.0), [4 / 3, 4 / 3, 4 / 3, 0])


def test_pressure_of_one_makes_all_equal():
    np.testing.assert_array_equal(linear_ranking_fitness(np.array([3, 1, 2]), 1.0), 1.0)


def test_parents_come_in_random_order():
    chosen = stochastic_universal_sampling(np.ones(200), 200, np.random.default_rng(1))
    assert sorted(chosen.tolist()) == list(range(200))
    assert np.count_nonzero(np.diff(chosen) > 0) < 150


def test_mean_number_of_copies_is_the_expectation():
    rng, fitness = np.random.default_rng(2), np.array([0.3, 1.1, 0.0, 1.6])
    spins = 4000
    counts = sum(np.bincount(stochastic_universal_sampling(fitness, 5, rng), minlength=4) for _ in range(spins))
    # A spin's count differs from its expectation by less than one: 0.5 / sqrt(4000) = 0.008 at most.
    np.testing.assert_allclose(counts / spins, 5 * fitness / 3.0, atol=0.04)
