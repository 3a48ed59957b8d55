"""The artifact of a reduced training set."""

from __future__ import annotations

from typing import ClassVar

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.spec import Format, Record, dataset, group, record


@record
class TraceGroup:
    """What a selection reaches after each sample."""

    condition_number: Array = dataset(
        "condition_number", "condition number after each sample; infinite while rank deficient", "selected", gaps=True
    )
    singular_value_min: Array = dataset(
        "singular_value_min", "smallest singular value after each", "selected", units="SI"
    )
    singular_value_max: Array = dataset(
        "singular_value_max", "largest singular value after each", "selected", units="SI"
    )


@record
class SelectionRecord(Record):
    """The artifact `cpfls/selection`."""

    FORMAT: ClassVar = Format(
        "cpfls/selection",
        "the samples of one flight that are worth learning from",
        "reduce",
        ("flight",),
    )

    indices: IntArray = dataset("indices", "indices into the flight, in order of selection", "selected")
    trace: TraceGroup = group("trace")
    rank: int = dataset("rank", "numerical rank of the selection")
    rank_full: int = dataset("rank_full", "numerical rank of all candidates")
    condition_number: float = dataset("condition_number", "of the selection, over the kept rank", gaps=True)
    condition_number_full: float = dataset("condition_number_full", "of all candidates, over the kept rank")
    candidates: int = dataset("candidates", "number of samples that could be selected")
    criterion: str = dataset("criterion", "the rule, as in reduction.criterion")
    exchanges: int | None = dataset("exchanges", "samples that were replaced by others on the way", default=None)
    stop_reason: str = dataset("stop_reason", "why the selection ended")
    random_condition_number: Array = dataset(
        "random/condition_number", "of random selections of equal size", "draw", gaps=True
    )
