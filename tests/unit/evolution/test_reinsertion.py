import numpy as np
import pytest

from cpfls_cli.evolution.reinsertion import reinsert
from cpfls_cli.evolution.subpopulations import subpopulation_labels

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
