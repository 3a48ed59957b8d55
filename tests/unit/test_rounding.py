"""What decides between computed numbers: a tie up to rounding is a tie on every machine."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.rounding import ROUNDING, apart, ascending, at_most, largest, less, levelled, smallest, tied

pytestmark = pytest.mark.decides

LAST_BITS = 1e-12


@pytest.mark.parametrize("size", [1e-300, 1e-6, 1.0, 5.85e8])
def test_rounding_decides_nothing_and_what_is_visible_does(size):
    a_little, clearly = size * (1 + LAST_BITS), size * (1 + 10 * ROUNDING)
    assert not less(size, a_little)
    assert at_most(a_little, size)
    assert tied(np.array([size]), np.array([a_little])).all()
    assert less(size, clearly)
    assert not at_most(clearly, size)


def test_a_difference_keeps_the_rounding_of_what_it_is_of():
    assert less(0.0, 1e-12)
    assert not less(0.0, 1e-12, scale=1.0)
    assert at_most(1e-12, 0.0, scale=1.0)


def test_what_is_not_finite_is_compared_as_it_is():
    assert less(1.0, np.inf)
    assert at_most(np.inf, np.inf)
    assert not less(np.inf, np.inf)
    for compared in (less, at_most):
        assert not compared(np.nan, 1.0)
        assert not compared(1.0, np.nan)
    np.testing.assert_array_equal(levelled(np.array([np.inf, np.nan, 1.0, np.inf])), [np.inf, np.nan, 1.0, np.inf])


@given(st.lists(st.integers(-3, 3), min_size=1, max_size=8), st.integers(0, 2**32 - 1))
def test_the_order_of_ties_is_that_of_the_items(values, seed):
    """Whatever the last bits are, the result is that of exact numbers."""
    rounded = np.array(values) * (1 + LAST_BITS * np.random.default_rng(seed).standard_normal(len(values)))
    items = range(len(values))
    assert ascending(items, rounded.__getitem__) == sorted(items, key=values.__getitem__)
    assert smallest(items, rounded.__getitem__) == values.index(min(values))
    assert largest(items, rounded.__getitem__) == values.index(max(values))
    assert len(set(levelled(rounded))) == len(set(values))


def test_nothing_has_no_order():
    assert ascending([], float) == []


@pytest.mark.parametrize(
    ("first", "second", "written"),
    [
        (0.266, 0.033, ("0.266", "0.033")),
        (0.26634, 0.26571, ("0.2663", "0.2657")),
        (1.0, 1.0 + 1e-12, ("1", "1")),
        (4403, 62.0, ("4400", "62")),
    ],
)
def test_numbers_that_a_sentence_compares_differ_as_they_are_written(first, second, written):
    assert apart(first, second) == written
