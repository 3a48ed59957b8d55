import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from cpfls_cli.evolution import gray_decode, gray_encode


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
