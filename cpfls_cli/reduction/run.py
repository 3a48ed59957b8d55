"""A selection under way: the start's samples first, then the criterion's."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.reduction.criterion import Criterion
from cpfls_cli.reduction.factor import TriangularFactor
from cpfls_cli.reduction.row_space import RowSpace
from cpfls_cli.reduction.selection import Selection, StopReason


class Run:
    """Samples chosen so far, their factor and the trace.

    Parameters
    ----------
    space : RowSpace
    criterion : Criterion
    start : array of int
        Samples to choose before the criterion is asked.
    """

    def __init__(self, space: RowSpace, criterion: Criterion, start: IntArray) -> None:
        self._space, self._criterion, self._start = space, criterion, start
        self._available = np.ones(space.samples, dtype=bool)
        self.factor = TriangularFactor(space.rank, space.rank_tolerance)
        self.indices: list[int] = []
        self._trace: list[tuple[float, float, float, int]] = []

    def step(self) -> None:
        """Choose one more sample."""
        index = self._next_sample()
        self._available[index] = False
        self.indices.append(index)
        self.factor.add(self._space.rows[index])
        factor = self.factor
        self._trace.append((factor.condition_number, factor.singular_value_min, factor.singular_value_max, factor.rank))

    def _next_sample(self) -> int:
        if len(self.indices) < len(self._start):
            return int(self._start[len(self.indices)])
        return self._criterion.next_sample(self.factor, self._available)

    def selection(self, criterion: str, reason: StopReason) -> Selection:
        """Return the result under a criterion's name, with what ended the selection."""
        condition_number, smallest, largest, rank = (np.array(column) for column in zip(*self._trace, strict=True))
        return Selection(
            criterion=criterion,
            indices=np.array(self.indices, dtype=np.int64),
            condition_number=self.factor.condition_number,
            condition_number_full=self._space.condition_number,
            rank=self.factor.rank,
            rank_full=self._space.rank,
            condition_number_trace=condition_number,
            singular_value_min_trace=smallest,
            singular_value_max_trace=largest,
            rank_trace=rank.astype(np.int64),
            stop_reason=reason,
        )
