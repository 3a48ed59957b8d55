"""Random selections of samples, the baseline of every other."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.reduction.factor import TriangularFactor
from cpfls_cli.reduction.selection import Subset
from cpfls_cli.reduction.survey import Survey, survey

# Rows wait until so many samples are together, because a QR factorisation of few rows costs as much as of many.
_WAITING_SAMPLES = 256


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

    Raises
    ------
    ComputationError
        If Q has the wrong shape or a value that is not finite, or if the size is not between 1 and the number
        of samples.
    """
    return random_streamed(survey(lambda: [Q], rank_tolerance), size, count, rng)


def random_streamed(surveyed: Survey, size: int, count: int, rng: np.random.Generator) -> tuple[Subset, ...]:
    """Choose samples of a surveyed regressor at random as `random_selections` does, in one pass.

    Parameters
    ----------
    surveyed : Survey
    size : int
        Samples to choose.
    count : int
        Subsets to choose, independently of each other.
    rng : numpy.random.Generator

    Raises
    ------
    ComputationError
        If the size is not between 1 and the number of samples.
    """
    if not 1 <= size <= surveyed.samples:
        raise ComputationError(f"size = {size}: expected 1 to {surveyed.samples}, the number of samples")
    draws = [_Draw(rng.choice(surveyed.samples, size, replace=False), surveyed) for _ in range(count)]
    first = 0
    for rows in surveyed.projected():
        for draw in draws:
            draw.take(first, rows)
        first += len(rows)
    return tuple(draw.subset() for draw in draws)


class _Draw:
    """One random choice, its rows taken from passing blocks."""

    def __init__(self, indices: IntArray, surveyed: Survey) -> None:
        self._indices, self._surveyed = indices, surveyed
        self._ascending = np.sort(indices)
        self._factor = TriangularFactor(surveyed.rank, surveyed.rank_tolerance)
        self._waiting: list[Array] = []

    def take(self, first: int, rows: Array) -> None:
        begin, end = np.searchsorted(self._ascending, [first, first + len(rows)])
        self._waiting.append(rows[self._ascending[begin:end] - first])
        if sum(map(len, self._waiting)) >= _WAITING_SAMPLES:
            self._add_waiting()

    def _add_waiting(self) -> None:
        self._factor.add(np.concatenate(self._waiting).reshape(-1, self._surveyed.rank))
        self._waiting = []

    def subset(self) -> Subset:
        if self._waiting:
            self._add_waiting()
        return Subset(
            criterion="random",
            indices=self._indices,
            condition_number=self._factor.condition_number,
            condition_number_full=self._surveyed.condition_number,
            rank=self._factor.rank,
            rank_full=self._surveyed.rank,
        )
