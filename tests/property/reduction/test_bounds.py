"""The bounds that let samples be skipped never exclude the best one."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.reduction.criteria import eigenvalues_below, largest_eigenvalue_bound, smallest_eigenvalue_bound

seeds = st.integers(0, 2**32 - 1)
columns = st.integers(1, 7)
scales = st.floats(1e-3, 1e3)


def updates(seed, columns, scale, samples=6):
    """Ascending eigenvalues, rows in the eigenvectors' basis, and the exact updated eigenvalues."""
    rng = np.random.default_rng(seed)
    eigenvalues = np.sort(rng.exponential(1.0, columns) * np.geomspace(1, 100, columns))
    Z = rng.standard_normal((samples, 3, columns)) * scale
    exact = np.linalg.eigvalsh(np.diag(eigenvalues) + Z.swapaxes(1, 2) @ Z)
    return eigenvalues, Z, exact


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
