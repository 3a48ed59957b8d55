"""Chromosomes: weights of all partitions as genes, the breakpoints they stand for, and how these follow from them."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.fuzzy.membership import breakpoints
from cpfls_cli.regressor.structure import ModelStructure

LARGEST_GENE = 2**16 - 1


def decode(structure: ModelStructure, weights: Array) -> tuple[Array, ...]:
    """Decode weights into the breakpoints of every partition.

    Parameters
    ----------
    weights : array, shape (genes,), >= 0
        Genes, or weights on any scale: only their ratios within a partition count.

    Returns
    -------
    tuple of array, shape (functions,)
        NaN in a partition whose weights are all zero.

    References
    ----------
    Equation (10); method.md sections 4 and 7 for the order.
    """
    decoded: list[Array] = [np.empty(0)] * len(structure.partitions)
    for partitions, genes in structure.alike:
        for index, ends in zip(partitions, breakpoints(weights[genes]), strict=True):
            decoded[index] = ends
    return tuple(decoded)


def encode(weights: Array) -> IntArray:
    """Round weights on [0, 1] to genes.

    Parameters
    ----------
    weights : array, shape (genes,)

    Returns
    -------
    array of int, shape (genes,)
        At least 1: a function of zero width would make the output jump.
    """
    return np.clip(np.rint(weights * LARGEST_GENE), 1, LARGEST_GENE).astype(np.int64)


def weight_jacobian(structure: ModelStructure, weights: Array) -> Array:
    """Differentiate all inner breakpoints by all weights, ``d b_k / d a_j = ([j <= k] - b_k) / sum a``.

    Parameters
    ----------
    weights : array, shape (genes,)
        No partition all zero.

    Returns
    -------
    array, shape (inner breakpoints of all partitions, genes)
    """
    inner = np.concatenate([ends[1:-1] for ends in decode(structure, weights)])
    total = np.array([np.sum(weights[part]) for part in structure.weight_slices()])
    own, counted, partition = structure.inner
    return np.where(own, (counted - inner[:, None]) / total[partition][:, None], 0.0)


def uniform_chromosome(structure: ModelStructure) -> IntArray:
    """Encode the equidistant partitions, shape (genes,)."""
    return np.full(structure.genes, LARGEST_GENE // 2, dtype=np.int64)
