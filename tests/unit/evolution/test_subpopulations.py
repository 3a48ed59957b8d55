import numpy as np
import pytest

from cpfls_cli.evolution.subpopulations import members, migrate, reinsert, subpopulation_labels


@pytest.mark.parametrize(
    ("population", "subpopulations", "sizes"),
    [(75, 5, [15] * 5), (17, 5, [4, 4, 3, 3, 3]), (6, 1, [6])],
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
    labels = subpopulation_labels(200, 2)
    source = migrate(labels, 0.29, np.random.default_rng(4))
    assert np.count_nonzero(source[:100] != np.arange(100)) == 29


PARENTS, OFFSPRING = subpopulation_labels(30, 2), subpopulation_labels(24, 2)
RANKS = np.random.default_rng(1).permutation(54)
GENES = np.arange(54)[:, np.newaxis]


def split(values, labels):
    return [values[labels == label] for label in (0, 1)]


@pytest.mark.parametrize("method", ["uniform", "fitness"])
def test_the_fittest_offspring_of_each_subpopulation_enter(method):
    source = reinsert(GENES, RANKS, PARENTS, OFFSPRING, 0.8, method, np.random.default_rng(2))
    for places, offspring_ranks in zip(split(source, PARENTS), split(RANKS[30:], OFFSPRING), strict=True):
        # 12 offspring, 0.8 of them is 9.6, rounded 10
        assert sorted(RANKS[places[places >= 30]]) == sorted(offspring_ranks)[:10]


def test_fitness_based_reinsertion_keeps_the_fittest_parents():
    source = reinsert(GENES, RANKS, PARENTS, OFFSPRING, 0.8, "fitness", np.random.default_rng(3))
    for places, parent_ranks in zip(split(source, PARENTS), split(RANKS[:30], PARENTS), strict=True):
        assert sorted(RANKS[places[places < 30]]) == sorted(parent_ranks)[:5]


def test_uniform_reinsertion_replaces_each_parent_equally_often():
    rng = np.random.default_rng(4)
    runs = [reinsert(GENES, RANKS, PARENTS, OFFSPRING, 0.8, "uniform", rng) for _ in range(1500)]
    replaced = np.mean([source != np.arange(30) for source in runs], axis=0)
    # 10 of 15, standard deviation 0.012: the best parent is lost as often as the worst.
    np.testing.assert_allclose(replaced, 2 / 3, atol=0.06)


def test_survivors_keep_their_places():
    source = reinsert(GENES, RANKS, PARENTS, OFFSPRING, 0.8, "uniform", np.random.default_rng(5))
    kept = source < 30
    np.testing.assert_array_equal(source[kept], np.flatnonzero(kept))


def test_fitness_based_reinsertion_breaks_ties_at_random():
    rng = np.random.default_rng(6)
    kept = {
        tuple(reinsert(GENES, np.zeros(54, dtype=int), PARENTS, OFFSPRING, 0.8, "fitness", rng) < 30) for _ in range(20)
    }
    assert len(kept) > 10


def test_elitist_reinsertion_keeps_the_fittest_of_parents_and_offspring():
    source = reinsert(GENES, RANKS, PARENTS, OFFSPRING, 1.0, "elitist", np.random.default_rng(6))
    labels = np.concatenate([PARENTS, OFFSPRING])
    for places, ranks in zip(split(source, PARENTS), split(RANKS, labels), strict=True):
        assert sorted(RANKS[places]) == sorted(ranks)[:15]


def test_elitist_reinsertion_keeps_one_of_equal_chromosomes_as_long_as_there_are_others():
    genes = np.array([[5], [5], [7], [8], [5], [9]])
    ranks, labels = np.array([1, 1, 4, 6, 1, 5]), np.zeros(4, dtype=int)
    kept = reinsert(genes, ranks, labels, labels[:2], 1.0, "elitist", np.random.default_rng(7))
    assert kept.tolist() == [0, 2, 5, 3]
    kept = reinsert(np.full((6, 1), 5), ranks, labels, labels[:2], 1.0, "elitist", np.random.default_rng(7))
    assert sorted(ranks[kept]) == [1, 1, 1, 4]
