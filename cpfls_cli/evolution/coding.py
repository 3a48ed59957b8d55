"""Gray coding of unsigned integer genes."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import BoolArray, IntArray

BITS_PER_GENE = 16


def gray_encode(genes: IntArray, bits_per_gene: int = BITS_PER_GENE) -> BoolArray:
    """Write genes as reflected Gray code, ``g XOR (g >> 1)``, most significant bit first.

    Parameters
    ----------
    genes : array, shape (individuals, genes)
        Integers from 0 to ``2**bits_per_gene - 1``.
    bits_per_gene : int

    Returns
    -------
    array of bool, shape (individuals, genes * bits_per_gene)
        Neighbouring integers differ in one bit.
    """
    code = genes ^ (genes >> 1)
    bits = (code[..., np.newaxis] >> _shifts(bits_per_gene)) & 1
    return bits.astype(np.bool_).reshape(len(genes), -1)


def gray_decode(bits: BoolArray, bits_per_gene: int = BITS_PER_GENE) -> IntArray:
    """Read genes from reflected Gray code, as BS2RV of the Sheffield toolbox does with integer bounds.

    Parameters
    ----------
    bits : array of bool, shape (individuals, genes * bits_per_gene)
        Most significant bit first.
    bits_per_gene : int

    Returns
    -------
    array of int, shape (individuals, genes)
    """
    code = bits.reshape(len(bits), bits.shape[1] // bits_per_gene, bits_per_gene)
    binary = np.logical_xor.accumulate(code, axis=-1)
    genes: IntArray = (binary.astype(np.int64) << _shifts(bits_per_gene)).sum(axis=-1)
    return genes


def _shifts(bits_per_gene: int) -> IntArray:
    return np.arange(bits_per_gene, dtype=np.int64)[::-1]
