"""Gray codes and parents for any genes and fitness."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from cpfls_cli.evolution.engine import (
    gray_decode,
    gray_encode,
    linear_ranking_fitness,
    stochastic_universal_sampling,
)


@given(st.data(), st.integers(1, 20))
def test_decoding_undoes_encoding(data, bits_per_gene):
    shape = data.draw(array_shapes(min_dims=2, max_dims=2, max_side=6))
    genes = data.draw(arrays(np.int64, shape, elements=st.integers(0, 2**bits_per_gene - 1)))
    bits = gray_encode(genes, bits_per_gene)
    assert bits.shape == (shape[0], shape[1] * bits_per_gene)
    np.testing.assert_array_equal(gray_decode(bits, bits_per_gene), genes)


@given(st.data(), st.integers(1, 20))
def test_encoding_undoes_decoding(data, bits_per_gene):
    bits = data.draw(arrays(np.bool_, (3, 2 * bits_per_gene)))
    np.testing.assert_array_equal(gray_encode(gray_decode(bits, bits_per_gene), bits_per_gene), bits)


RANKS = arrays(np.int64, st.integers(2, 40), elements=st.integers(-5, 5))


@given(RANKS, st.floats(1, 2))
def test_fitness_has_mean_one_stays_in_bounds_and_follows_the_ranks(ranks, pressure):
    fitness = linear_ranking_fitness(ranks, pressure)
    np.testing.assert_allclose(fitness.mean(), 1.0)
    assert fitness.min() >= 2 - pressure - 1e-12
    assert fitness.max() <= pressure + 1e-12
    assert np.all(np.diff(fitness[np.argsort(ranks)]) <= 0)


@given(arrays(np.int64, st.integers(1, 30), elements=st.integers(0, 9)), st.integers(1, 60), st.integers(0, 99))
def test_each_individual_is_chosen_its_expectation_rounded_down_or_up(weights, count, seed):
    weights[0] += 1
    chosen = stochastic_universal_sampling(weights.astype(float), count, np.random.default_rng(seed))
    copies = np.bincount(chosen, minlength=len(weights))
    expectation = count * weights / weights.sum()
    # Rounding may move a pointer over the edge of a sector whose width is a whole number of spacings.
    assert len(chosen) == count
    assert np.all(copies >= np.floor(expectation - 1e-9))
    assert np.all(copies <= np.ceil(expectation + 1e-9))
