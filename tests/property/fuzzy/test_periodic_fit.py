"""Any fitted system is periodic, linear in its values, and differentiates itself correctly."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cpfls_cli.fuzzy.periodic import PeriodicSettings, fit_periodic

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
@given(STRUCTURES, SEEDS, st.tuples(st.integers(-50, 50), st.integers(-50, 50)))
def test_periodic(structure, seed, turns):
    angles, values, elsewhere = drawn(seed)
    system = fit_periodic(angles, values[0], structure)
    shifted = elsewhere + 2 * np.pi * np.array(turns)
    scale = 1 + np.abs(system.coefficients).max()
    np.testing.assert_allclose(system(shifted), system(elsewhere), atol=1e-10 * scale)


@settings(deadline=None, max_examples=25)
@given(STRUCTURES, SEEDS)
def test_linear_in_the_values(structure, seed):
    angles, values, elsewhere = drawn(seed)
    one, other, both = (fit_periodic(angles, v, structure) for v in (*values, 2 * values[0] - values[1]))
    scale = 1 + max(np.abs(one.coefficients).max(), np.abs(other.coefficients).max())
    np.testing.assert_allclose(both(elsewhere), 2 * one(elsewhere) - other(elsewhere), atol=1e-8 * scale)


@settings(deadline=None, max_examples=25)
@given(STRUCTURES, SEEDS)
def test_gradient_is_that_of_the_function(structure, seed):
    angles, values, elsewhere = drawn(seed)
    system = fit_periodic(angles, values[0], structure)
    # The triangle wave has a kink at a quarter of a turn.
    smooth = np.all(np.abs(np.abs(elsewhere) - np.pi / 2) > 2 * STEP, axis=1)
    points = elsewhere[smooth]
    scale = 1 + np.abs(system.coefficients).max()
    for angle in (0, 1):
        step = STEP * np.eye(2)[angle]
        difference = (system(points + step) - system(points - step)) / (2 * STEP)
        np.testing.assert_allclose(system.gradient(points)[:, angle], difference, atol=1e-4 * scale)
