"""Membership functions and periodic fits of any partition."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cpfls_cli.fuzzy.basis import breakpoints, join_ends, memberships, uniform_weights
from cpfls_cli.fuzzy.periodic import PeriodicSettings, fit_periodic

genes = st.lists(st.integers(0, 2**16 - 1) | st.just(0), max_size=8).filter(lambda a: not a or sum(a) > 0)
positive_genes = st.lists(st.integers(300, 2**16 - 1), min_size=1, max_size=8)
inputs = st.lists(st.floats(-0.5, 1.5), min_size=1, max_size=20)


def zadeh_z(x, left, right):
    """Equation (8) with its squares."""
    middle = 0.5 * (left + right)
    if x <= left:
        return 1.0
    if x > right:
        return 0.0
    u = (x - left) / (right - left)
    return 1 - 2 * u**2 if x <= middle else 2 * (1 - u) ** 2


def written_out(x, b):
    """z, pi, ..., pi, s of one input."""
    rising = [1 - zadeh_z(x, b[k - 1], b[k]) if k else 1.0 for k in range(len(b))]
    falling = [zadeh_z(x, b[k], b[k + 1]) if k + 1 < len(b) else 1.0 for k in range(len(b))]
    return [rising[k] if x <= b[k] else falling[k] for k in range(len(b))]


@given(genes, inputs)
def test_partition_of_unity(weights, x):
    b = breakpoints(np.array(weights, dtype=float))
    degrees = memberships(np.array(x + list(b)), b)
    assert degrees.value.shape[1] == len(weights) + 1
    assert np.all((degrees.value >= 0) & (degrees.value <= 1))
    np.testing.assert_allclose(degrees.value.sum(axis=1), 1.0, atol=1e-12)
    scale = np.maximum(np.abs(degrees.slope).max(axis=1), 1.0)
    np.testing.assert_allclose(degrees.slope.sum(axis=1) / scale, 0.0, atol=1e-12)


@given(genes, inputs)
def test_joining_the_ends_keeps_the_unity(weights, x):
    b = breakpoints(np.array(weights, dtype=float))
    joined = join_ends(memberships(np.array(x), b).value)
    assert joined.shape[1] == max(len(b) - 1, 1)
    np.testing.assert_allclose(joined.sum(axis=1), 1.0, atol=1e-12)


@given(positive_genes, inputs)
def test_equation_8_written_out(weights, x):
    b = breakpoints(np.array(weights, dtype=float))
    expected = [written_out(float(np.clip(value, 0, 1)), b) for value in x]
    np.testing.assert_allclose(memberships(np.array(x), b).value, expected, atol=1e-9)


@given(positive_genes)
def test_smooth_at_every_breakpoint(weights):
    """C1: the bound is what a slope that changes by at most 4 / width^2 per unit of input can do in this step."""
    b = breakpoints(np.array(weights, dtype=float))
    width = np.diff(b).min()
    step = 1e-6 * width
    before, at, after = (memberships(b + s, b) for s in (-step, 0.0, step))
    np.testing.assert_allclose(at.value, np.eye(len(b)), atol=1e-12)
    np.testing.assert_allclose(at.slope, 0.0, atol=1e-9 / width)
    np.testing.assert_allclose(before.value, after.value, atol=1e-9)
    np.testing.assert_allclose(before.slope, after.slope, atol=9 * step / width**2 + 1e-12 / width)


@given(genes.filter(bool))
def test_breakpoints_ascend_from_0_to_1_on_any_scale(weights):
    a = np.array(weights, dtype=float)
    b = breakpoints(a)
    assert (b[0], b[-1]) == (0.0, 1.0)
    assert np.all(np.diff(b) >= -1e-15)
    np.testing.assert_allclose(breakpoints(1e-3 * a), b, atol=1e-14)


@given(st.integers(1, 15))
def test_uniform_weights_are_equidistant(functions):
    expected = np.linspace(0, 1, functions) if functions > 1 else [0.0]
    np.testing.assert_allclose(breakpoints(uniform_weights(functions)), expected, atol=1e-15)


STRUCTURES = st.builds(
    PeriodicSettings,
    membership_functions=st.tuples(st.integers(1, 5), st.integers(1, 5)),
    consequents=st.sampled_from(["harmonic", "seesaw"]),
    harmonic_order=st.integers(1, 2),
    products=st.sampled_from(["additive", "tensor"]),
    ridge_weight=st.sampled_from([1e-6, 1e-3]),
)
SEEDS = st.integers(0, 2**32 - 1)
STEP = 1e-6


def drawn(seed):
    rng = np.random.default_rng(seed)
    return rng.uniform(-10, 10, (300, 2)), rng.standard_normal((2, 300)), rng.uniform(-3, 3, (50, 2))


@settings(deadline=None, max_examples=25)
@given(STRUCTURES, SEEDS)
def test_gradient_is_that_of_the_function(structure, seed):
    angles, values, elsewhere = drawn(seed)
    system = fit_periodic(angles, values[0], structure)
    # The triangle wave has a kink at a quarter of a turn.
    points = elsewhere[np.all(np.abs(np.abs(elsewhere) - np.pi / 2) > 2 * STEP, axis=1)]
    scale = 1 + np.abs(system.coefficients).max()
    for angle in (0, 1):
        step = STEP * np.eye(2)[angle]
        difference = (system(points + step) - system(points - step)) / (2 * STEP)
        np.testing.assert_allclose(system.gradient(points)[:, angle], difference, atol=1e-4 * scale)
