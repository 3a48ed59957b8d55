import numpy as np

from cpfls_cli.evolution import gray_decode, gray_encode
from cpfls_cli.evolution.operators import (
    intermediate_recombination,
    linear_ranking_fitness,
    mutate,
    single_point_crossover,
    stochastic_universal_sampling,
)


def test_three_bit_code_is_the_published_table():
    table = ["000", "001", "011", "010", "110", "111", "101", "100"]
    bits = gray_encode(np.arange(8)[:, np.newaxis], bits_per_gene=3)
    assert ["".join(str(int(bit)) for bit in row) for row in bits] == table


def test_genes_lie_one_after_another_most_significant_bit_first():
    bits = gray_encode(np.array([[65535, 0]]))
    assert np.flatnonzero(bits[0]).tolist() == [0]
    assert gray_decode(bits).tolist() == [[65535, 0]]


def test_every_pair_of_neighbours_differs_in_one_bit():
    bits = gray_encode(np.arange(2**16)[:, np.newaxis])
    assert np.all(np.count_nonzero(bits[1:] != bits[:-1], axis=1) == 1)


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


def alternating(individuals, length):
    return np.tile([[False], [True]], (individuals, 1))[:individuals] & np.ones(length, dtype=bool)


def test_each_pair_exchanges_one_tail_and_an_odd_last_row_stays():
    bits = alternating(2001, 9)
    offspring = single_point_crossover(bits, 1.0, np.random.default_rng(3))
    kept = np.count_nonzero(~offspring[0:2000:2], axis=1)
    expected = np.arange(9) >= kept[:, np.newaxis]
    np.testing.assert_array_equal(offspring[0:2000:2], expected)
    np.testing.assert_array_equal(offspring[1:2000:2], ~expected)
    np.testing.assert_array_equal(offspring[2000], bits[2000])
    # Points 1 to 8 are equally likely: 125 of 1000 each, standard deviation 10.5.
    assert np.unique(kept).tolist() == list(range(1, 9))
    assert np.all(np.abs(np.bincount(kept)[1:] - 125) < 50)


def test_crossover_rate_is_the_share_of_crossed_pairs():
    bits = alternating(10000, 16)
    offspring = single_point_crossover(bits, 0.8, np.random.default_rng(4))
    crossed = np.any(offspring != bits, axis=1)[::2]
    assert abs(crossed.mean() - 0.8) < 0.025


def test_crossover_rate_zero_changes_nothing():
    bits = alternating(10, 16)
    np.testing.assert_array_equal(single_point_crossover(bits, 0.0, np.random.default_rng(5)), bits)


def test_a_single_bit_has_no_point_to_cross_at():
    bits = alternating(4, 1)
    np.testing.assert_array_equal(single_point_crossover(bits, 1.0, np.random.default_rng(6)), bits)


def test_mutation_shares_are_those_asked_for():
    bits = np.random.default_rng(7).random((20000, 384)) < 0.5
    changed = mutate(bits, 0.04, 0.01, np.random.default_rng(8)) != bits
    mutated = np.any(changed, axis=1)
    # 0.04 (1 - 0.99^384) = 0.0392; standard deviations 0.0014 and 0.0002.
    assert abs(mutated.mean() - 0.0392) < 0.006
    assert abs(changed[mutated].mean() - 0.0102) < 0.001


def test_mutation_of_every_bit_is_the_complement():
    bits = np.random.default_rng(9).random((5, 7)) < 0.5
    np.testing.assert_array_equal(mutate(bits, 1.0, 1.0, np.random.default_rng(10)), ~bits)


def test_intermediate_offspring_lie_uniformly_between_their_parents_and_a_quarter_beyond():
    genes = np.tile([[20000], [40000]], (5000, 3))
    offspring = intermediate_recombination(genes, 1.0, 65535, np.random.default_rng(8))
    assert offspring.min() >= 15000
    assert offspring.max() <= 45000
    shares = np.histogram(offspring, bins=6, range=(15000, 45000))[0] / offspring.size
    # 30000 draws, a sixth in each bin: standard deviation 0.002.
    np.testing.assert_allclose(shares, 1 / 6, atol=0.012)


def test_intermediate_offspring_of_a_pair_are_drawn_gene_by_gene_and_apart():
    genes = np.tile([[10000], [50000]], (1000, 2))
    offspring = intermediate_recombination(genes, 1.0, 65535, np.random.default_rng(9))
    first, second = offspring[::2], offspring[1::2]
    assert abs(np.corrcoef(first[:, 0], first[:, 1])[0, 1]) < 0.15
    assert abs(np.corrcoef(first[:, 0], second[:, 0])[0, 1]) < 0.15


def test_intermediate_recombination_stays_in_range_and_takes_its_share_of_the_pairs():
    genes = np.tile([[0], [65535]], (10001, 1))[:20001]
    offspring = intermediate_recombination(genes, 0.8, 65535, np.random.default_rng(10))
    assert offspring.min() == 0
    assert offspring.max() == 65535
    changed = (offspring != genes)[:20000, 0].reshape(-1, 2)
    # An end of the range stays where it is clipped to it: a sixth of the draws.
    assert abs(changed.any(axis=1).mean() - 0.8 * (1 - 1 / 36)) < 0.02
    assert offspring[20000] == genes[20000]


def test_equal_parents_have_equal_offspring():
    genes = np.tile(np.arange(7), (4, 1))
    np.testing.assert_array_equal(intermediate_recombination(genes, 1.0, 65535, np.random.default_rng(11)), genes)
