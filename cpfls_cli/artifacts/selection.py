"""The artifact of a reduced training set."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.spec import Format, Record, dataset, group, group_of, record

if TYPE_CHECKING:
    from cpfls_cli.reduction.selection import Selection


@record
class TraceGroup:
    """What a selection reaches after each sample."""

    condition_number: Array = dataset(
        "condition number after each sample; infinite while rank deficient", "selected", gaps=True, least=1.0
    )
    singular_value_min: Array = dataset("smallest singular value after each", "selected", units="SI")
    singular_value_max: Array = dataset("largest singular value after each", "selected", units="SI")


@record
class SelectionRecord(Record):
    """The artifact `cpfls/selection`."""

    FORMAT: ClassVar = Format(
        "cpfls/selection",
        "the samples of one flight that are worth learning from",
        "reduce",
        ("flight",),
    )

    indices: IntArray = dataset("indices into the flight, in order of selection", "selected")
    trace: TraceGroup = group()
    rank: int = dataset("numerical rank of the selection")
    rank_full: int = dataset("numerical rank of all candidates")
    condition_number: float = dataset("of the selection, over the kept rank", gaps=True, least=1.0)
    condition_number_full: float = dataset("of all candidates, over the kept rank", least=1.0)
    candidates: int = dataset("number of samples that could be selected")
    criterion: str = dataset("the rule, as in reduction.criterion")
    exchanges: int | None = dataset("samples that were replaced by others on the way", default=None)
    stop_reason: str = dataset("why the selection ended")
    random_condition_number: Array = dataset(
        "of random selections of equal size", "draw", path="random/condition_number", gaps=True, least=1.0
    )

    @classmethod
    def of(cls, selection: Selection, indices: IntArray, candidates: int, random: Array) -> Self:
        """Arrange a selection, its indices into all samples of the flights, beside random ones of equal size."""
        return group_of(
            cls,
            selection,
            indices=indices,
            trace=TraceGroup(
                condition_number=selection.condition_number_trace,
                singular_value_min=selection.singular_value_min_trace,
                singular_value_max=selection.singular_value_max_trace,
            ),
            candidates=candidates,
            random_condition_number=random,
        )

    @property
    def deficient(self) -> bool:
        """Whether it determines less than all samples do, so that it must not be trained on."""
        return self.rank < self.rank_full

    @property
    def random_median(self) -> float:
        """Condition number of random selections of equal size, the median; NaN where none was drawn."""
        return float(np.median(self.random_condition_number)) if len(self.random_condition_number) else float("nan")

    @property
    def summary(self) -> dict[str, Any]:
        """The selection for machines."""
        return {
            "samples": self.candidates,
            "selected": len(self.indices),
            "criterion": self.criterion,
            "rank": self.rank,
            "rank_full": self.rank_full,
            "condition_number": self.condition_number,
            "condition_number_full": self.condition_number_full,
            "condition_number_random": self.random_median,
            "exchanges": self.exchanges,
            "stop_reason": self.stop_reason,
            "stalled": self.deficient,
        }
