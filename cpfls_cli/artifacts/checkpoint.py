"""The artifact of a search that has not come to its end."""

from __future__ import annotations

from typing import Any, ClassVar

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.spec import Format, Record, dataset, group, record


@record
class HistoryGroup:
    """Progress of the search by generation."""

    evaluations: IntArray = dataset("evaluations", "chromosomes evaluated so far", "generation")
    best: Array = dataset("best", "best of each objective so far", "generation", "3", units="SI", gaps=True)
    front_size: IntArray = dataset("front_size", "members of the Pareto front so far", "generation")


@record
class PopulationGroup:
    """The current population."""

    genes: Any = dataset("genes", "chromosomes, 16-bit weights", "individual", "gene")
    objectives: Any = dataset(
        "objectives",
        "MSE (rigid-body base: cross-validated, scaled by axis), largest error, condition number",
        "individual",
        "3",
        units="SI",
        gaps=True,
    )
    subpopulation: Any = dataset("subpopulation", "label of the subpopulation", "individual")


@record
class ArchiveGroup:
    """All evaluated chromosomes."""

    submitted: Any = dataset("submitted", "chromosomes as bred, in order of evaluation", "evaluation", "gene")
    genes: Any = dataset("genes", "what local search made of them", "evaluation", "gene")
    objectives: Any = dataset(
        "objectives",
        "MSE (rigid-body base: cross-validated, scaled by axis), largest error, condition number",
        "evaluation",
        "3",
        units="SI",
        gaps=True,
    )


@record
class UnfinishedGroup:
    """What was evaluated of the next generation, where the search was stopped within it."""

    submitted: Any = dataset(
        "submitted",
        "chromosomes of the next generation that are evaluated, where the search was stopped within it",
        "unfinished",
        "gene",
    )
    genes: Any = dataset("genes", "what local search made of them", "unfinished", "gene")
    objectives: Any = dataset(
        "objectives",
        "MSE (rigid-body base: cross-validated, scaled by axis), largest error, condition number",
        "unfinished",
        "3",
        units="SI",
        gaps=True,
    )


@record
class CheckpointRecord(Record):
    """The artifact `cpfls/checkpoint`."""

    FORMAT: ClassVar = Format(
        "cpfls/checkpoint",
        "a search that has not come to its end: all that its next generation depends on",
        "identify, sweep",
        ("flight", "selection", "validate", "choose-on"),
    )

    generation: int = dataset("generation", "generations bred; 0: initial population, -1: not even that")
    generator: str = dataset(
        "generator", "state of the random generator, one for all subpopulations, as JSON; null at -1"
    )
    population: PopulationGroup = group("population")
    archive: ArchiveGroup = group("archive")
    history: HistoryGroup = group("history")
    unfinished: UnfinishedGroup = group("unfinished")
    sha256: str = dataset("sha256", "of the bytes of all datasets above, in this order")
