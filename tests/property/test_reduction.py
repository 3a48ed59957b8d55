"""Reductions of any size: bounds, selections and compound matrices."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cpfls_cli.reduction.criteria import (
    Compound,
    eigenvalues_below,
    largest_eigenvalue_bound,
    smallest_eigenvalue_bound,
)
from cpfls_cli.reduction.settings import ReductionSettings
from tests.builders.reductions import reduce

seeds = st.integers(0, 2**32 - 1)
columns = st.integers(1, 7)
scales = st.floats(1e-3, 1e3)
criteria = st.sampled_from(["KD-exchange", "K-exchange", "sigma_min", "A", "D", "paper-literal"])
column_counts = st.integers(1, 6)
powers = st.sampled_from([1.0, 2.0, 4.0, 16.0])
weights = st.sampled_from([0.0, 2.0])


def updates(seed, columns, scale, samples=6):
    """Ascending eigenvalues, rows in the eigenvectors' basis, and the exact updated eigenvalues."""
    rng = np.random.default_rng(seed)
    eigenvalues = np.sort(rng.exponential(1.0, columns) * np.geomspace(1, 100, columns))
    Z = rng.standard_normal((samples, 3, columns)) * scale
    return eigenvalues, Z, np.linalg.eigvalsh(np.diag(eigenvalues) + Z.swapaxes(1, 2) @ Z)


@given(seeds, columns, scales)
def test_smallest_eigenvalue_is_below_its_bound(seed, columns, scale):
    eigenvalues, Z, exact = updates(seed, columns, scale)
    bound = smallest_eigenvalue_bound(eigenvalues, Z[:, :, :2])
    assert np.all(bound >= exact[:, 0] - 1e-13 * exact[:, -1])
    assert np.all(bound <= eigenvalues[0] + np.sum(Z[:, :, 0] ** 2, axis=1) + 1e-12 * exact[:, -1])


@given(seeds, columns, scales)
def test_largest_eigenvalue_is_below_its_bound(seed, columns, scale):
    eigenvalues, Z, exact = updates(seed, columns, scale)
    bound = largest_eigenvalue_bound(eigenvalues[::-1], Z[:, :, -1], np.sum(Z**2, axis=(1, 2)))
    assert np.all(bound >= exact[:, -1] * (1 - 1e-13))
    assert np.all(bound <= eigenvalues[-1] + np.sum(Z**2, axis=(1, 2)) + 1e-12 * exact[:, -1])


@given(seeds, columns, scales, st.floats(0.0, 1.0))
def test_counted_eigenvalues_are_those_computed(seed, columns, scale, place):
    eigenvalues, Z, exact = updates(seed, columns, scale)
    shift = (1 - place) * exact.min() + place * exact.max() + 1e-6
    if np.min(np.abs(exact - shift)) > 1e-9 * exact.max():
        assert eigenvalues_below(eigenvalues, Z, shift).tolist() == np.sum(exact < shift, axis=1).tolist()


@given(seeds, st.integers(2, 7), scales, st.data())
def test_fewer_eigenvectors_never_exclude_a_sample(seed, columns, scale, data):
    eigenvalues, Z, exact = updates(seed, columns, scale)
    count = data.draw(st.integers(1, columns))
    level = float(np.median(exact[:, 0]))
    partial = eigenvalues_below(eigenvalues[:count], Z[:, :, :count], level) == 0
    assert np.all(partial[exact[:, 0] > level + 1e-12 * exact.max()])


def regressor(seed):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((20, 3, 5)) * rng.uniform(0.2, 2.0, (20, 1, 1))


@settings(deadline=None, max_examples=40)
@given(seeds, criteria, st.integers(-20, 20))
def test_units_and_orthogonal_coordinates_do_not_matter(seed, criterion, exponent):
    Q, rotation = regressor(seed), np.linalg.qr(np.random.default_rng(seed).standard_normal((5, 5)))[0]
    chosen = reduce(Q, ReductionSettings(criterion=criterion, size=12))
    moved = reduce(2.0**exponent * Q @ rotation, ReductionSettings(criterion=criterion, size=12))
    assert chosen.indices.tolist() == moved.indices.tolist()
    assert np.isclose(chosen.condition_number, moved.condition_number, rtol=1e-9)


@settings(deadline=None, max_examples=30)
@given(seeds, criteria)
def test_order_of_samples_does_not_matter(seed, criterion):
    Q, order = regressor(seed), np.random.default_rng(seed).permutation(20)
    chosen = reduce(Q, ReductionSettings(criterion=criterion, size=12)).indices
    shuffled = reduce(Q[order], ReductionSettings(criterion=criterion, size=12)).indices
    assert order[shuffled].tolist() == chosen.tolist()


def gram(seed, column_counts):
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((10, 3, column_counts)) * np.geomspace(1.0, 0.1, column_counts)
    return rows, np.einsum("nij,nik->jk", rows, rows)


def by_definition(G, power, information):
    """From powers of the matrix itself."""
    sign, logarithm = np.linalg.slogdet(G)
    high, low = (np.trace(np.linalg.matrix_power(M, int(power))) for M in (G, np.linalg.inv(G)))
    assert sign > 0
    return np.log(high * low) / power - information * logarithm / len(G)


@given(seeds, column_counts, powers, weights)
def test_value_is_that_of_the_definition(seed, column_counts, power, information):
    _, G = gram(seed, column_counts)
    value = Compound(power, information).value(np.linalg.eigvalsh(G))
    assert np.isclose(value, by_definition(G, power, information), rtol=1e-7, atol=1e-7)


@given(seeds, column_counts, powers, weights, st.booleans())
def test_merit_of_a_faint_sample_is_the_derivative(seed, column_counts, power, information, chosen):
    rows, G = gram(seed, column_counts)
    criterion, faint = Compound(power, information), 1e-3 * rows
    merits = criterion.merits(faint, *np.linalg.eigh(G), chosen=chosen)
    now = by_definition(G, power, information)
    sign = -1 if chosen else 1
    falls = [sign * (now - by_definition(G + sign * R.T @ R, power, information)) for R in faint]
    # What a chosen sample lowers is what its removal would raise. Curvature is of the order of the square.
    assert np.allclose(merits, falls, rtol=1e-2, atol=1e-7)


@given(seeds, column_counts)
def test_information_term_is_exact_for_large_samples(seed, column_counts):
    rows, G = gram(seed, column_counts)
    eigen = np.linalg.eigh(G)
    parts = [Compound(1.0, w).merits(rows, *eigen, chosen=True) for w in (0.0, 1.0)]
    without = [np.linalg.slogdet(G - R.T @ R)[1] for R in rows]
    assert np.allclose(parts[1] - parts[0], (np.linalg.slogdet(G)[1] - without) / column_counts, rtol=1e-5)
