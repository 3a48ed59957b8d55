"""Which column of the paper a setting stands beside."""

from benchmarks.paper.beside import printed_beside
from benchmarks.paper.printed import TABLE_5
from tests.builders.sweeps import setting_of


def setting(structure="cpfls", samples=685, population=500, generations=200):
    return setting_of([1.0], structure, samples, (population, generations))


def test_the_papers_own_settings_find_their_columns():
    own = [setting(c.structure, c.samples, c.population, c.generations) for c in TABLE_5]
    assert printed_beside(own) == list(TABLE_5)
    assert printed_beside(own[::-1]) == list(TABLE_5)[::-1]


def test_smaller_searches_take_the_columns_in_order_but_leave_exact_ones():
    small, exact = setting(population=20, generations=5), setting(population=75, generations=25)
    assert printed_beside([small, exact]) == [TABLE_5[4], TABLE_5[5]]
    assert printed_beside([exact, small]) == [TABLE_5[5], TABLE_5[4]]
    assert printed_beside([small, exact, small]) == [TABLE_5[4], TABLE_5[5], None]


def test_other_settings_have_none():
    assert printed_beside([setting(samples=80), setting("fls", 685)]) == [None, None]
