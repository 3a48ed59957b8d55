"""The artifacts of searches that have not come to their end: for a model, and for the structure of a vehicle."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.spec import Format, Record, columns_of, dataset, group, group_of, record
from cpfls_cli.evolution.engine import EvolutionState, History

if TYPE_CHECKING:
    # `search/checkpoint.py` and `search/vehicle_search.py` make of it again what a search goes on from.
    from cpfls_cli.identification.search import Unfinished
    from cpfls_cli.playback.structure import Judged

_BEFORE_ALL = -1
_NO_GENERATOR = "null"


@record
class HistoryGroup:
    """Progress of the search by generation."""

    evaluations: IntArray = dataset("chromosomes evaluated so far", "generation")
    best: Array = dataset("best of each objective so far", "generation", "3", units="SI", gaps=True)
    front_size: IntArray = dataset("members of the Pareto front so far", "generation")


@record
class PopulationGroup:
    """The current population."""

    genes: Any = dataset("chromosomes, 16-bit weights", "individual", "gene")
    objectives: Any = dataset(
        "MSE (rigid-body base: cross-validated, scaled by axis), largest error, condition number",
        "individual",
        "3",
        units="SI",
        gaps=True,
    )
    subpopulation: Any = dataset("label of the subpopulation", "individual")


@record
class ArchiveGroup:
    """All evaluated chromosomes."""

    submitted: Any = dataset("chromosomes as bred, in order of evaluation", "evaluation", "gene")
    genes: Any = dataset("what local search made of them", "evaluation", "gene")
    objectives: Any = dataset(
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
        "chromosomes of the next generation that were evaluated, if the search was stopped within it",
        "unfinished",
        "gene",
    )
    genes: Any = dataset("what local search made of them", "unfinished", "gene")
    objectives: Any = dataset(
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
        "an unfinished search: everything that its next generation depends on",
        "identify, sweep",
        ("flight", "selection", "validate", "choose-on"),
    )

    generation: int = dataset("generations bred; 0: initial population, -1: not even that")
    generator: str = dataset("state of the random generator, one for all subpopulations, as JSON; null at -1")
    population: PopulationGroup = group()
    archive: ArchiveGroup = group()
    history: HistoryGroup = group()
    unfinished: UnfinishedGroup = group()

    @classmethod
    def of_state(cls, state: EvolutionState) -> Self:
        """Arrange the state of a search after a generation."""
        archive, results = state.archive.submitted, state.archive.results
        generator = json.dumps(state.rng.bit_generator.state)
        population = (state.genes, state.objectives, state.subpopulations)
        stored = _stored(archive, results.genes, results.objectives)
        return cls._arranged(state.index, generator, population, stored, state.history)

    @classmethod
    def of_nothing(cls, unfinished: Unfinished) -> Self:
        """Arrange a search that has not evaluated its whole initial population, only this part of it."""
        none, objectives = unfinished.submitted[:0], unfinished.evaluation.objectives[:0]
        population, history = (none, objectives, np.arange(0)), History.empty(objectives.shape[1])
        stored = _stored(none, none, objectives)
        return cls._arranged(_BEFORE_ALL, _NO_GENERATOR, population, stored, history).with_unfinished(unfinished)

    @classmethod
    def _arranged(
        cls,
        generation: int,
        generator: str,
        population: tuple[IntArray, Array, IntArray],
        archive: dict[str, Any],
        history: History,
    ) -> Self:
        genes, objectives, subpopulation = population
        return cls(
            generation=generation,
            generator=generator,
            population=PopulationGroup(
                genes=genes.astype(np.uint16), objectives=objectives, subpopulation=subpopulation
            ),
            archive=ArchiveGroup(**archive),
            history=group_of(HistoryGroup, history),
            unfinished=UnfinishedGroup(**_stored(genes[:0], genes[:0], objectives[:0])),
        )

    def with_unfinished(self, unfinished: Unfinished) -> Self:
        """Replace what was evaluated of the next generation."""
        evaluation = unfinished.evaluation
        stored = _stored(unfinished.submitted, evaluation.genes, evaluation.objectives)
        return replace(self, unfinished=UnfinishedGroup(**stored))

    @property
    def begun(self) -> bool:
        """Whether the initial population was evaluated whole."""
        return self.generation > _BEFORE_ALL


def _stored(submitted: IntArray, genes: IntArray, objectives: Array) -> dict[str, Any]:
    return {"submitted": submitted.astype(np.uint16), "genes": genes.astype(np.uint16), "objectives": objectives}


@record
class StructuresKeptGroup:
    """Structures that were judged, in the order of the search."""

    blocks: tuple[str, ...] = dataset("blocks of each, one space between two", "structure")
    rules: IntArray = dataset("of its remainder: number of rules, order of the harmonics", "structure", "2")
    numbers: IntArray = dataset("free numbers", "structure")


@record
class VehicleCheckpointRecord(Record):
    """The artifact `cpfls/vehicle-checkpoint`."""

    FORMAT: ClassVar = Format(
        "cpfls/vehicle-checkpoint",
        "an unfinished search for the structure of a vehicle: what was fitted so far",
        "vehicle",
        ("flight-1", "held-out-1"),
    )

    structure: StructuresKeptGroup = group()
    loss: Array = dataset("of the fit to all parts of the flights, and without each of them", "structure", "fit")
    values: Array = dataset("numbers of all fits, one fit after another", "fitted", units="SI")
    hessian: Array = dataset("curvatures of the fits to all parts by rows, one fit after another", "curvature")

    @classmethod
    def of(cls, judged: Sequence[Judged]) -> Self:
        """Arrange the structures that were judged, at least one."""
        fits = [(each.fit, *each.without) for each in judged]
        return cls(
            structure=columns_of(
                StructuresKeptGroup,
                judged,
                blocks=tuple(" ".join(each.structure.blocks) for each in judged),
                rules=np.array([each.structure.rules for each in judged], dtype=np.int64),
            ),
            loss=np.array([[fitted.loss for fitted in own] for own in fits]),
            values=np.concatenate([fitted.values for own in fits for fitted in own]),
            hessian=np.concatenate([each.fit.hessian.ravel() for each in judged]),
        )
