"""The search for non-dominated partitions: the genetic algorithm over a model's evaluator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.engine import evolve
from cpfls_cli.evolution.state import Generation
from cpfls_cli.identification.choice import choose
from cpfls_cli.identification.chromosome import uniform_chromosome
from cpfls_cli.identification.evaluator import Evaluator
from cpfls_cli.identification.results import Front, History
from cpfls_cli.identification.settings import IdentificationSettings

Progress = Callable[[int, int, Array], None]


def search(
    evaluator: Evaluator, settings: IdentificationSettings, rng: np.random.Generator, progress: Progress | None
) -> tuple[Front, History]:
    """Search for non-dominated partitions.

    Parameters
    ----------
    evaluator : Evaluator
    settings : IdentificationSettings
    rng : numpy.random.Generator
    progress : callable, optional

    Returns
    -------
    front : Front
    history : History

    Raises
    ------
    ComputationError
        If no chromosome gives a finite model.
    """
    structure = evaluator.regressor.structure
    if structure.genes == 0:
        only = evaluator(uniform_chromosome(structure)[None])
        objectives = only.objectives
        history = History(np.array([1]), objectives, np.array([1]))
        return Front(only.genes, objectives, 0), history
    generations: list[Generation] = []
    initial = uniform_chromosome(structure)[None] if settings.start == "with-uniform" else None
    for generation in evolve(evaluator, structure.genes, settings, rng, initial):
        generations.append(generation)
        if progress is not None:
            progress(generation.index, settings.generations, _best(generation))
    last = generations[-1]
    usable = np.isfinite(last.front_objectives).all(axis=1)
    if not usable.any():
        raise ComputationError("no chromosome gave a finite model; the data may not move at all")
    objectives = last.front_objectives[usable]
    front = Front(last.front_genes[usable], objectives, choose(objectives, settings.choice))
    history = History(
        np.array([g.evaluations for g in generations]),
        np.array([_best(g) for g in generations]),
        np.array([len(g.front_genes) for g in generations]),
    )
    return front, history


def _best(generation: Generation) -> Array:
    return np.asarray(np.min(generation.front_objectives, axis=0))
