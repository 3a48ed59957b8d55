"""Samples taken at random, the baseline of every selection."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError
from cpfls_cli.reduction.factor import TriangularFactor
from cpfls_cli.reduction.row_space import RowSpace, row_space
from cpfls_cli.reduction.selection import Subset


def random_selections(
    Q: Array, size: int, count: int, rng: np.random.Generator, rank_tolerance: float = 1e-10
) -> tuple[Subset, ...]:
    """Choose samples at random, each with the same probability and none twice, several times over.

    Parameters
    ----------
    Q : array, shape (samples, 3, parameters)
    size : int
        Samples to choose.
    count : int
        Subsets to choose, independently of each other.
    rng : numpy.random.Generator
    rank_tolerance : float
        Singular values below this fraction of the largest count as zero.

    Returns
    -------
    tuple of Subset

    Raises
    ------
    ComputationError
        If Q has the wrong shape or a value that is not finite, or if the size is not between 1 and the number
        of samples.
    """
    space = row_space(Q, rank_tolerance)
    if not 1 <= size <= space.samples:
        raise ComputationError(f"size = {size}: expected 1 to {space.samples}, the number of samples")
    return tuple(_random_subset(space, size, rng) for _ in range(count))


def _random_subset(space: RowSpace, size: int, rng: np.random.Generator) -> Subset:
    indices = rng.choice(space.samples, size, replace=False)
    factor = TriangularFactor(space.rank, space.rank_tolerance)
    factor.add(space.rows[indices].reshape(-1, space.rank))
    return Subset(
        criterion="random",
        indices=indices,
        condition_number=factor.condition_number,
        condition_number_full=space.condition_number,
        rank=factor.rank,
        rank_full=space.rank,
    )
