"""The result of a reduction, and the selection in progress: the samples of the start, then those of the criterion."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.reduction.criteria import EXCHANGE_INFORMATION, Criterion, TriangularFactor
from cpfls_cli.reduction.survey import RowSpace
from cpfls_cli.result import about, result

StopReason = Literal["size", "condition-number", "all-samples", "pool"]


@result
class Selection:
    """The samples of flights that are worth learning from, with the history of their selection."""

    FORMAT: ClassVar = "cpfls/selection"
    SHOWN: ClassVar = ("selected", "stalled", "condition_number_random")

    indices: IntArray = about("indices of the samples, in order of selection", "selected", least=0, brief=False)
    candidates: int = about("number of samples that could be selected", default=0)
    criterion: str = about("the rule, as in reduction.criterion")
    rank: int = about("numerical rank of the selection")
    rank_full: int = about("numerical rank of all candidates")
    condition_number: float = about(
        "largest over smallest singular value, over as many as the rank of all; infinite below that rank",
        gaps=True,
        least=1.0,
    )
    condition_number_full: float = about("of all candidates, over the kept rank", least=1.0)
    stop_reason: StopReason = about("which limit ended the selection; the pool where it, and not all, was used up")
    exchanges: int = about("samples that were replaced by others on the way", default=0)
    condition_number_trace: Array = about(
        "condition number after each sample; infinite while rank deficient",
        "selected",
        gaps=True,
        least=1.0,
        brief=False,
    )
    singular_value_min_trace: Array = about("smallest singular value after each", "selected", unit="SI", brief=False)
    singular_value_max_trace: Array = about("largest singular value after each", "selected", unit="SI", brief=False)
    rank_trace: IntArray = about("numerical rank after each", "selected", brief=False)
    random: Array | None = about(
        "condition numbers of random selections of equal size", "draw", gaps=True, least=1.0, brief=False, default=None
    )

    @property
    def selected(self) -> int:
        """Number of samples."""
        return len(self.indices)

    @property
    def full_rank(self) -> bool:
        """Whether the samples determine everything that all candidates determine."""
        return self.rank == self.rank_full

    @property
    def stalled(self) -> bool:
        """Whether the rule ended below full rank, so that the selection must not be trained on."""
        return not self.full_rank

    @property
    def condition_number_random(self) -> float:
        """Condition number of random selections of equal size, the median; NaN where none was drawn."""
        return float(np.median(self.random)) if self.random is not None and len(self.random) else float("nan")

    def beginning(self, size: int) -> Selection | None:
        """Give what a smaller size would have chosen, or None where this selection did not begin with it.

        Samples that are chosen one by one do not depend on what comes after them. Exchanges and every n-th sample know
        the size from the start, and some criteria refuse a size below the full rank.
        """
        one_by_one = self.criterion not in {*EXCHANGE_INFORMATION, "even"}
        if not one_by_one or size > len(self.indices) or self.rank_trace[size - 1] < self.rank_full:
            return None
        return replace(
            self,
            indices=self.indices[:size],
            condition_number=float(self.condition_number_trace[size - 1]),
            rank=self.rank_full,
            condition_number_trace=self.condition_number_trace[:size],
            singular_value_min_trace=self.singular_value_min_trace[:size],
            singular_value_max_trace=self.singular_value_max_trace[:size],
            rank_trace=self.rank_trace[:size],
            stop_reason="size" if size < len(self.indices) else self.stop_reason,
        )


class SelectionRun:
    """Samples chosen so far, from those before the criterion is asked on, their factor and the trace."""

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
