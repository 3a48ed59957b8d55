"""The search for non-dominated partitions: the genetic algorithm over a model's evaluator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.archive import Evaluate, Evaluation
from cpfls_cli.evolution.engine import evolve
from cpfls_cli.evolution.state import Generation, best
from cpfls_cli.identification.choice import choose
from cpfls_cli.identification.chromosome import uniform_chromosome
from cpfls_cli.identification.evaluator import Evaluator
from cpfls_cli.identification.results import Front, History
from cpfls_cli.identification.settings import IdentificationSettings


@dataclass(frozen=True)
class SearchStep:
    """How far a search has come.

    Attributes
    ----------
    generation : int
        The generation under evaluation; 0 is the initial population.
    generations : int
        The last one.
    share : float
        Share of its new chromosomes that are evaluated.
    best : array, shape (3,), or None
        Best of each objective up to the generation before; None during the first.
    """

    generation: int
    generations: int
    share: float
    best: Array | None


Progress = Callable[[SearchStep], None]


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
    structure = evaluator.structure
    if structure.genes == 0:
        only = evaluator(uniform_chromosome(structure)[None])
        objectives = only.objectives
        history = History(np.array([1]), objectives, np.array([1]))
        return Front(only.genes, objectives, 0), history
    generations: list[Generation] = []
    evaluate = _watched(evaluator, generations, settings.generations, progress) if progress else evaluator
    initial = uniform_chromosome(structure)[None] if settings.start == "with-uniform" else None
    for generation in evolve(evaluate, structure.genes, settings, rng, initial):
        # One at a time: the progress of the next one reads them while it is bred.
        generations.append(generation)  # noqa: PERF402
    last = generations[-1]
    usable = np.isfinite(last.front_objectives).all(axis=1)
    if not usable.any():
        raise ComputationError("no chromosome gave a finite model; the data may not move at all")
    objectives = last.front_objectives[usable]
    front = Front(last.front_genes[usable], objectives, choose(objectives, settings.choice))
    history = History(
        np.array([g.evaluations for g in generations]),
        np.array([best(g) for g in generations]),
        np.array([len(g.front_genes) for g in generations]),
    )
    return front, history


def _watched(evaluator: Evaluator, past: Sequence[Generation], last: int, progress: Progress) -> Evaluate:
    """Evaluate one chromosome after the other, so that a long generation shows how far it has come."""

    def evaluate(genes: IntArray) -> Evaluation:
        best_so_far = best(past[-1]) if past else None
        parts = []
        for done in range(1, len(genes) + 1):
            parts.append(evaluator(genes[done - 1 : done]))
            progress(SearchStep(len(past), last, done / len(genes), best_so_far))
        refined, objectives = ([getattr(part, name) for part in parts] for name in ("genes", "objectives"))
        return Evaluation(np.concatenate(refined), np.concatenate(objectives))

    return evaluate
