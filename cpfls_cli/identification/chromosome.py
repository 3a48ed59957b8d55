"""Chromosomes: 16-bit integer genes that are the weights of all partitions of a model."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.fuzzy.partition import breakpoint_jacobian, breakpoints
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


def weight_jacobian(structure: ModelStructure, weights: Array, by_breakpoint: list[Array]) -> Array:
    """Turn derivatives by breakpoints into derivatives by weights.

    Parameters
    ----------
    structure : ModelStructure
    weights : array, shape (genes,)
    by_breakpoint : list of array, shape (samples, 3, functions - 2)
        One per partition.

    Returns
    -------
    array, shape (samples, 3, genes)
    """
    parts = [
        moved @ breakpoint_jacobian(weights[part])
        for moved, part in zip(by_breakpoint, structure.weight_slices(), strict=True)
    ]
    return np.concatenate(parts, axis=2)


def uniform_chromosome(structure: ModelStructure) -> IntArray:
    """Encode the equidistant partitions.

    Parameters
    ----------
    structure : ModelStructure

    Returns
    -------
    array of int, shape (genes,)
    """
    return np.full(structure.genes, LARGEST_GENE // 2, dtype=np.int64)
