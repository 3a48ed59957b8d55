import numpy as np
import pytest

from cpfls_cli.evolution.migration import migrate
from cpfls_cli.evolution.subpopulations import members, subpopulation_labels


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
