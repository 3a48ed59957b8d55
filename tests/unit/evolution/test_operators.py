import numpy as np
import pytest

from cpfls_cli.evolution.engine import (
    gray_decode,
    gray_encode,
    intermediate_recombination,
    linear_ranking_fitness,
    members,
    migrate,
    mutate,
    reinsert,
    single_point_crossover,
    stochastic_universal_sampling,
    subpopulation_labels,
)

PARENTS, OFFSPRING = subpopulation_labels(30, 2), subpopulation_labels(24, 2)
RANKS = np.random.default_rng(1).permutation(54)
GENES = np.arange(54)[:, np.newaxis]


def test_the_code_is_the_published_table_gene_after_gene():
    table = ["000", "001", "011", "010", "110", "111", "101", "100"]
    bits = gray_encode(np.arange(8)[:, np.newaxis], bits_per_gene=3)
    assert ["".join(str(int(bit)) for bit in row) for row in bits] == table
    bits = gray_encode(np.array([[65535, 0]]))
    assert np.flatnonzero(bits[0]).tolist() == [0]
    assert gray_decode(bits).tolist() == [[65535, 0]]


def test_fitness_falls_linearly_from_the_pressure_to_its_complement():
    np.testing.assert_allclose(linear_ranking_fitness(np.array([30, 10, 50, 20, 40]), 1.5), [1.0, 1.5, 0.5, 1.25, 0.75])


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
    crossed = np.any(single_point_crossover(bits, 0.8, np.random.default_rng(4)) != bits, axis=1)[::2]
    assert abs(crossed.mean() - 0.8) < 0.025
    bits = alternating(4, 1)
    np.testing.assert_array_equal(single_point_crossover(bits, 1.0, np.random.default_rng(6)), bits)


def test_mutation_shares_are_those_asked_for():
    bits = np.random.default_rng(7).random((20000, 384)) < 0.5
    changed = mutate(bits, 0.04, 0.01, np.random.default_rng(8)) != bits
    mutated = np.any(changed, axis=1)
    # 0.04 (1 - 0.99^384) = 0.0392; standard deviations 0.0014 and 0.0002.
    assert abs(mutated.mean() - 0.0392) < 0.006
    assert abs(changed[mutated].mean() - 0.0102) < 0.001


def test_intermediate_offspring_lie_uniformly_around_their_parents_gene_by_gene_and_in_range():
    genes = np.tile([[20000], [40000]], (5000, 3))
    offspring = intermediate_recombination(genes, 1.0, 65535, np.random.default_rng(8))
    assert offspring.min() >= 15000
    assert offspring.max() <= 45000
    shares = np.histogram(offspring, bins=6, range=(15000, 45000))[0] / offspring.size
    # 30000 draws, a sixth in each bin: standard deviation 0.002.
    np.testing.assert_allclose(shares, 1 / 6, atol=0.012)
    genes = np.tile([[10000], [50000]], (1000, 2))
    offspring = intermediate_recombination(genes, 1.0, 65535, np.random.default_rng(9))
    first, second = offspring[::2], offspring[1::2]
    assert abs(np.corrcoef(first[:, 0], first[:, 1])[0, 1]) < 0.15
    assert abs(np.corrcoef(first[:, 0], second[:, 0])[0, 1]) < 0.15
    genes = np.tile([[0], [65535]], (10001, 1))[:20001]
    offspring = intermediate_recombination(genes, 0.8, 65535, np.random.default_rng(10))
    assert (offspring.min(), offspring.max()) == (0, 65535)
    changed = (offspring != genes)[:20000, 0].reshape(-1, 2)
    # An end of the range stays where it is clipped to it: a sixth of the draws.
    assert abs(changed.any(axis=1).mean() - 0.8 * (1 - 1 / 36)) < 0.02
    assert offspring[20000] == genes[20000]


@pytest.mark.parametrize(
    ("population", "subpopulations", "sizes"), [(75, 5, [15] * 5), (17, 5, [4, 4, 3, 3, 3]), (6, 1, [6])]
)
def test_subpopulations_are_as_even_as_possible(population, subpopulations, sizes):
    groups = members(subpopulation_labels(population, subpopulations))
    assert [len(group) for group in groups] == sizes
    assert np.concatenate(groups).tolist() == list(range(population))


@pytest.mark.parametrize(("population", "moved"), [(75, 3), (77, 3), (23, 1)])
def test_each_subpopulation_receives_its_share_from_the_others(population, moved):
    labels = subpopulation_labels(population, 5)
    source = migrate(labels, 0.2, np.random.default_rng(1))
    for label, group in enumerate(members(labels)):
        arrivals = source[group] != group
        assert np.count_nonzero(arrivals) == moved
        assert label not in labels[source[group[arrivals]]]
        assert len(set(source[group].tolist())) == len(group)


def test_the_net_is_complete_and_everyone_may_leave_or_be_replaced():
    labels, rng = subpopulation_labels(20, 4), np.random.default_rng(2)
    routes, leaving, replaced = set(), set(), set()
    for _ in range(200):
        source = migrate(labels, 0.2, rng)
        places = np.flatnonzero(source != np.arange(20))
        routes |= {(int(labels[source[place]]), int(labels[place])) for place in places}
        leaving |= set(source[places].tolist())
        replaced |= set(places.tolist())
    assert len(routes) == 4 * 3
    assert leaving == replaced == set(range(20))


@pytest.mark.parametrize(("subpopulations", "rate"), [(1, 0.2), (5, 0.0)])
def test_nobody_moves(subpopulations, rate):
    labels = subpopulation_labels(20, subpopulations)
    np.testing.assert_array_equal(migrate(labels, rate, np.random.default_rng(3)), np.arange(20))


def test_a_share_that_is_whole_is_not_rounded_down():
    source = migrate(subpopulation_labels(200, 2), 0.29, np.random.default_rng(4))
    assert np.count_nonzero(source[:100] != np.arange(100)) == 29


def split(values, labels):
    return [values[labels == label] for label in (0, 1)]


@pytest.mark.parametrize("method", ["uniform", "fitness"])
def test_the_fittest_offspring_of_each_subpopulation_enter(method):
    source = reinsert(GENES, RANKS, PARENTS, OFFSPRING, 0.8, method, np.random.default_rng(2))
    for places, offspring_ranks in zip(split(source, PARENTS), split(RANKS[30:], OFFSPRING), strict=True):
        # 12 offspring, 0.8 of them is 9.6, rounded 10
        assert sorted(RANKS[places[places >= 30]]) == sorted(offspring_ranks)[:10]


def test_fitness_based_reinsertion_keeps_the_fittest_parents_and_breaks_ties_at_random():
    source = reinsert(GENES, RANKS, PARENTS, OFFSPRING, 0.8, "fitness", np.random.default_rng(3))
    for places, parent_ranks in zip(split(source, PARENTS), split(RANKS[:30], PARENTS), strict=True):
        assert sorted(RANKS[places[places < 30]]) == sorted(parent_ranks)[:5]
    rng = np.random.default_rng(6)
    kept = {
        tuple(reinsert(GENES, np.zeros(54, dtype=int), PARENTS, OFFSPRING, 0.8, "fitness", rng) < 30) for _ in range(20)
    }
    assert len(kept) > 10


def test_uniform_reinsertion_replaces_each_parent_equally_often_and_survivors_keep_their_places():
    rng = np.random.default_rng(4)
    runs = [reinsert(GENES, RANKS, PARENTS, OFFSPRING, 0.8, "uniform", rng) for _ in range(1500)]
    replaced = np.mean([source != np.arange(30) for source in runs], axis=0)
    # 10 of 15, standard deviation 0.012: the best parent is lost as often as the worst.
    np.testing.assert_allclose(replaced, 2 / 3, atol=0.06)
    source = reinsert(GENES, RANKS, PARENTS, OFFSPRING, 0.8, "uniform", np.random.default_rng(5))
    kept = source < 30
    np.testing.assert_array_equal(source[kept], np.flatnonzero(kept))


def test_elitist_reinsertion_keeps_the_fittest_and_one_of_equal_chromosomes():
    source = reinsert(GENES, RANKS, PARENTS, OFFSPRING, 1.0, "elitist", np.random.default_rng(6))
    labels = np.concatenate([PARENTS, OFFSPRING])
    for places, ranks in zip(split(source, PARENTS), split(RANKS, labels), strict=True):
        assert sorted(RANKS[places]) == sorted(ranks)[:15]
    genes = np.array([[5], [5], [7], [8], [5], [9]])
    ranks, labels = np.array([1, 1, 4, 6, 1, 5]), np.zeros(4, dtype=int)
    kept = reinsert(genes, ranks, labels, labels[:2], 1.0, "elitist", np.random.default_rng(7))
    assert kept.tolist() == [0, 2, 5, 3]
    kept = reinsert(np.full((6, 1), 5), ranks, labels, labels[:2], 1.0, "elitist", np.random.default_rng(7))
    assert sorted(ranks[kept]) == [1, 1, 1, 4]
