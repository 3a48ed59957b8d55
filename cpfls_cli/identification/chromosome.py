"""Chromosomes: 16-bit integer genes that are the weights of all partitions of a model."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.fuzzy.membership import breakpoint_jacobian, breakpoints
from cpfls_cli.regressor.structure import ModelStructure

LARGEST_GENE = 2**16 - 1


def decode(structure: ModelStructure, weights: Array) -> tuple[Array, ...]:
    """Decode weights into the breakpoints of every partition.

    Parameters
    ----------
    structure : ModelStructure
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
    return tuple(breakpoints(np.asarray(weights[part], dtype=float)) for part in structure.weight_slices())


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
    """Differentiate all inner breakpoints by all weights.

    Parameters
    ----------
    structure : ModelStructure
    weights : array, shape (genes,)
        No partition all zero.

    Returns
    -------
    array, shape (inner breakpoints of all partitions, genes)
    """
    parts = (weights[part] for part in structure.weight_slices())
    blocks = (breakpoint_jacobian(part) if len(part) > 1 else np.zeros((0, len(part))) for part in parts)
    return np.asarray(linalg.block_diag(*blocks), dtype=float)


def uniform_chromosome(structure: ModelStructure) -> IntArray:
    """Encode the equidistant partitions.

    Returns
    -------
    array of int, shape (genes,)
    """
    return np.full(structure.genes, LARGEST_GENE // 2, dtype=np.int64)
