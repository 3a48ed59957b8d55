"""Partitions at the edge: zero weights, zero widths, one function."""

import numpy as np
import pytest

from cpfls_cli.fuzzy.basis import breakpoints, memberships


@pytest.mark.parametrize("functions", [2, 3, 5])
def test_all_zero_weights_have_no_breakpoints(functions):
    b = breakpoints(np.zeros(functions - 1))
    assert b.shape == (functions,)
    assert np.isnan(b).all()


@pytest.mark.parametrize("weights", [[0, 1, 1], [1, 0, 1], [1, 1, 0], [0, 0, 1], [0, 1, 0], [1, 0, 0]])
def test_zero_widths_are_finite_steps(weights):
    b = breakpoints(np.array(weights, dtype=float))
    x = np.concatenate([np.linspace(0, 1, 41), b])
    degrees = memberships(x, b)
    assert np.isfinite(degrees.value).all()
    assert np.isfinite(degrees.slope).all()
    np.testing.assert_allclose(degrees.value.sum(axis=1), 1.0, atol=1e-15)


def test_a_function_between_two_empty_intervals_never_fires_inside():
    """b = 0, 1/2, 1/2, 1/2, 1: the middle function has no width on either side."""
    b = breakpoints(np.array([1.0, 0.0, 0.0, 1.0]))
    inside = np.setdiff1d(np.linspace(0, 1, 101), [0.5])
    np.testing.assert_array_equal(memberships(inside, b).value[:, 2], 0.0)


def test_one_function_is_everywhere_one():
    degrees = memberships(np.linspace(-1, 2, 7), breakpoints(np.empty(0)))
    np.testing.assert_array_equal(degrees.value, np.ones((7, 1)))
    np.testing.assert_array_equal(degrees.slope, np.zeros((7, 1)))


def test_beyond_the_ends_the_outer_functions_stay_at_one():
    degrees = memberships(np.array([-0.3, 1.3]), np.array([0.0, 0.4, 1.0]))
    np.testing.assert_array_equal(degrees.value, [[1, 0, 0], [0, 0, 1]])
    np.testing.assert_array_equal(degrees.slope, np.zeros((2, 3)))
