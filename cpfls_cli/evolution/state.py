"""State of a running evolution, and what is reported of it after each generation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Archive
from cpfls_cli.evolution.history import History


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
    rng : numpy.random.Generator
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
    """Give the smallest value of each objective among all chromosomes ever evaluated.

    Returns
    -------
    array, shape (objectives,)
        +inf where no chromosome had a finite value.
    """
    # The front holds the smallest value of every objective, so the archive itself is not needed.
    smallest: Array = generation.front_objectives.min(axis=0)
    return smallest
