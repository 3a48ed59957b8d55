"""The compound criterion and its merits against their definitions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.reduction.exchange import Compound

seeds = st.integers(0, 2**32 - 1)
columns = st.integers(1, 6)
powers = st.sampled_from([1.0, 2.0, 4.0, 16.0])
weights = st.sampled_from([0.0, 2.0])


def gram(seed, columns):
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((10, 3, columns)) * np.geomspace(1.0, 0.1, columns)
    return rows, np.einsum("nij,nik->jk", rows, rows)


def by_definition(G, power, information):
    """From powers of the matrix itself."""
    sign, logarithm = np.linalg.slogdet(G)
    high, low = (np.trace(np.linalg.matrix_power(M, int(power))) for M in (G, np.linalg.inv(G)))
    assert sign > 0
    return np.log(high * low) / power - information * logarithm / len(G)


@given(seeds, columns, powers, weights)
def test_value_is_that_of_the_definition(seed, columns, power, information):
    _, G = gram(seed, columns)
    value = Compound(power, information).value(np.linalg.eigvalsh(G))
    assert np.isclose(value, by_definition(G, power, information), rtol=1e-7, atol=1e-7)


@given(seeds, columns, powers)
def test_smooth_condition_number_is_an_upper_bound_and_close(seed, columns, power):
    _, G = gram(seed, columns)
    excess = Compound(power, 0.0).value(np.linalg.eigvalsh(G)) - np.log(np.linalg.cond(G))
    assert -1e-9 <= excess <= 2 / power * np.log(columns) + 1e-9


@given(seeds, columns, powers, weights, st.booleans())
def test_merit_of_a_faint_sample_is_the_derivative(seed, columns, power, information, chosen):
    rows, G = gram(seed, columns)
    criterion, faint = Compound(power, information), 1e-3 * rows
    merits = criterion.merits(faint, *np.linalg.eigh(G), chosen=chosen)
    now = by_definition(G, power, information)
    sign = -1 if chosen else 1
    falls = [sign * (now - by_definition(G + sign * R.T @ R, power, information)) for R in faint]
    # What a chosen sample lowers is what its removal would raise. Curvature is of the order of the square.
    assert np.allclose(merits, falls, rtol=1e-2, atol=1e-7)


@given(seeds, columns)
def test_information_term_is_exact_for_large_samples(seed, columns):
    rows, G = gram(seed, columns)
    eigen = np.linalg.eigh(G)
    parts = [Compound(1.0, w).merits(rows, *eigen, chosen=True) for w in (0.0, 1.0)]
    without = [np.linalg.slogdet(G - R.T @ R)[1] for R in rows]
    assert np.allclose(parts[1] - parts[0], (np.linalg.slogdet(G)[1] - without) / columns, rtol=1e-5)
