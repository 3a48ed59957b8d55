import numpy as np

from cpfls_cli.evolution import gray_decode, gray_encode


def test_three_bit_code_is_the_published_table():
    table = ["000", "001", "011", "010", "110", "111", "101", "100"]
    bits = gray_encode(np.arange(8)[:, np.newaxis], bits_per_gene=3)
    assert ["".join(str(int(bit)) for bit in row) for row in bits] == table


def test_genes_lie_one_after_another_most_significant_bit_first():
    bits = gray_encode(np.array([[65535, 0]]))
    assert np.flatnonzero(bits[0]).tolist() == [0]
    assert gray_decode(bits).tolist() == [[65535, 0]]


def test_every_pair_of_neighbours_differs_in_one_bit():
    bits = gray_encode(np.arange(2**16)[:, np.newaxis])
    assert np.all(np.count_nonzero(bits[1:] != bits[:-1], axis=1) == 1)
