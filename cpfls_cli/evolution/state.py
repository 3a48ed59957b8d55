"""State of a running evolution, its history, the report of a generation, and the conditions of its end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Archive
from cpfls_cli.evolution.settings import EvolutionSettings
from cpfls_cli.rounding import at_most

End = Literal["generations", "converged"]


@dataclass(frozen=True)
class History:
    """Course of the search, one row for each generation from the initial population on.

    Attributes
    ----------
    evaluations : array of int, shape (generations + 1,)
        Chromosomes evaluated so far.
    best : array, shape (generations + 1, objectives)
        Best of each objective so far; +inf where none had a finite value.
    front_size : array of int, shape (generations + 1,)
        Members of the Pareto front so far.
    """

    evaluations: IntArray
    best: Array
    front_size: IntArray

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.evaluations)

    @classmethod
    def empty(cls, objectives: int) -> History:
        """Create the history of no generation, for this number of objectives."""
        none = np.empty(0, dtype=np.int64)
        return cls(none, np.empty((0, objectives)), none)

    def extended(self, archive: Archive) -> History:
        """Add a row of what has been evaluated by now, one chromosome at least."""
        front = archive.front.objectives
        # The front holds the smallest value of every objective, so the rest of the archive is not needed.
        return History(
            np.append(self.evaluations, len(archive)),
            np.concatenate([self.best, front.min(axis=0, keepdims=True)]),
            np.append(self.front_size, len(front)),
        )


@dataclass(frozen=True)
class Generation:
    """Report a population after one generation.

    Parameters
    ----------
    index : int
        Generations bred so far; 0 is the initial population.
    genes : array of int, shape (population, genes)
        Chromosomes, after the evaluator refined them.
    objectives : array, shape (population, objectives)
        To be minimised; +inf where the evaluator gave no finite value.
    subpopulations : array of int, shape (population,)
        Label of each individual's subpopulation.
    evaluations : int
        Chromosomes evaluated so far, each counted once.
    front_genes : array of int, shape (front, genes)
        Non-dominated chromosomes among all ever evaluated.
    front_objectives : array, shape (front, objectives)
        Their objectives.
    """

    index: int
    genes: IntArray
    objectives: Array
    subpopulations: IntArray
    evaluations: int
    front_genes: IntArray
    front_objectives: Array


@dataclass(frozen=True)
class EvolutionState:
    """Hold all that the next generation depends on, and all that a stopped evolution needs to go on.

    The archive and the random generator are carried along and change with each step; copy the state deeply, or
    store its parts, to be able to return to it. One generator serves all subpopulations, in their order.

    Parameters
    ----------
    index : int
        Generations bred so far.
    genes : array of int, shape (population, genes)
    objectives : array, shape (population, objectives)
    subpopulations : array of int, shape (population,)
    archive : Archive
        Every chromosome evaluated so far.
    history : History
        One row for each generation, this one included.
    """

    index: int
    genes: IntArray
    objectives: Array
    subpopulations: IntArray
    archive: Archive
    history: History
    rng: np.random.Generator

    def report(self) -> Generation:
        """Report this generation, with the front of the archive."""
        front = self.archive.front
        return Generation(
            index=self.index,
            genes=self.genes,
            objectives=self.objectives,
            subpopulations=self.subpopulations,
            evaluations=len(self.archive),
            front_genes=front.genes,
            front_objectives=front.objectives,
        )


def best(generation: Generation) -> Array:
    """Give the smallest value of each objective among all chromosomes ever evaluated; +inf where none was finite."""
    # The front holds the smallest value of every objective, so the archive itself is not needed.
    smallest: Array = generation.front_objectives.min(axis=0)
    return smallest


def ended(state: EvolutionState, settings: EvolutionSettings) -> End | None:
    """Tell why an evolution has reached its end; None where another generation is to be bred."""
    if state.index >= settings.generations:
        return "generations"
    return "converged" if stalled(state.history, settings.stall_generations, settings.stall_improvement) else None


def stalled(history: History, generations: int | None, improvement: float) -> bool:
    """Tell whether the best of no objective improved enough over the last generations.

    ``best_before - best_now <= improvement * |best_before|`` for every objective.

    Parameters
    ----------
    generations : int or None
        Generations looked back; never stalled if None.
    improvement : float
        Relative improvement that is not enough. An objective that got its first finite value improved, and a history
        that is shorter is not stalled.
    """
    if generations is None or len(history) <= generations:
        return False
    before, now = history.best[-1 - generations], history.best[-1]
    known = np.isfinite(before)
    if np.any(np.isfinite(now[~known])):
        return False
    size = np.abs(before[known])
    return bool(np.all(at_most(before[known] - now[known], improvement * size, size)))
