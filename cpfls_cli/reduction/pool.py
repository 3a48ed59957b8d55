"""The samples of a long flight that a selection chooses from: as many as fit in memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.reduction.factor import TriangularFactor
from cpfls_cli.reduction.row_space import RowSpace, space_of
from cpfls_cli.reduction.survey import Survey

# Of a sample without leverage; places not yet taken have less.
_LOWEST_KEY = -np.finfo(float).max


@dataclass(frozen=True)
class Pool:
    """Samples held in memory out of all those surveyed.

    Attributes
    ----------
    indices : array of int, shape (pool,)
        Which samples they are, ascending.
    space : RowSpace
        Their rows.
    """

    indices: IntArray
    space: RowSpace


def draw_pool(surveyed: Survey, size: int, rng: np.random.Generator) -> Pool:
    """Hold all samples where they fit, else draw some without replacement by their leverage, in one pass.

    The leverage ``h_i = trace(R_i (Q^T Q)^-1 R_i^T)`` says how much of what all samples determine rests on sample
    i: one that alone determines a direction has 1 or more. Sample i gets the key ``log(u_i) / h_i`` with u_i
    uniform, and the largest keys are kept.

    Parameters
    ----------
    surveyed : Survey
    size : int
        Samples to hold at most.
    rng : numpy.random.Generator
        One number per sample is drawn, in order, and none where all samples fit.

    Raises
    ------
    ComputationError
        If the samples drawn do not determine all that the whole regressor determines.

    References
    ----------
    Efraimidis, Spirakis 2006: Weighted random sampling with a reservoir.
    """
    if surveyed.samples <= size:
        rows = np.concatenate(list(surveyed.projected()))
        return Pool(np.arange(len(rows)), space_of(surveyed, rows))
    reservoir = _Reservoir(size, surveyed.rank)
    for rows in surveyed.projected():
        leverage = np.sum((rows / surveyed.singular_values) ** 2, axis=(1, 2))
        with np.errstate(divide="ignore"):
            keys = np.log(rng.random(len(rows))) / leverage
        reservoir.offer(np.maximum(keys, _LOWEST_KEY), rows)
    order = np.argsort(reservoir.indices)
    pool = Pool(reservoir.indices[order], space_of(surveyed, reservoir.rows[order]))
    _require_rank(pool.space, size)
    return pool


class _Reservoir:
    """The rows with the largest keys so far."""

    def __init__(self, size: int, columns: int) -> None:
        self._keys = np.full(size, -np.inf)
        self.indices: IntArray = np.full(size, -1, dtype=np.int64)
        self.rows: Array = np.zeros((size, 3, columns))
        self._offered = 0

    def offer(self, keys: Array, rows: Array) -> None:
        size = len(self._keys)
        kept = np.zeros(size + len(keys), dtype=bool)
        kept[np.argpartition(np.concatenate([self._keys, keys]), len(keys))[-size:]] = True
        entering = np.flatnonzero(kept[size:])
        leaving = np.flatnonzero(~kept[:size])
        self._keys[leaving], self.rows[leaving] = keys[entering], rows[entering]
        self.indices[leaving] = self._offered + entering
        self._offered += len(keys)


def _require_rank(space: RowSpace, size: int) -> None:
    factor = TriangularFactor(space.rank, space.rank_tolerance)
    factor.add(space.rows.reshape(-1, space.rank))
    if not factor.full_rank:
        raise ComputationError(
            f"reduction.pool = {size}: samples drawn have rank {factor.rank}, all samples {space.rank}; raise it"
        )
