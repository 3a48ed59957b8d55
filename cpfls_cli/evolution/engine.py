"""The genetic algorithm: its state, history and end; breed, evaluate, reinsert, migrate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.archive import Archive, Evaluate, Evaluation
from cpfls_cli.evolution.operators import (
    BITS_PER_GENE,
    gray_decode,
    gray_encode,
    intermediate_recombination,
    linear_ranking_fitness,
    members,
    migrate,
    mutate,
    reinsert,
    single_point_crossover,
    stochastic_universal_sampling,
    subpopulation_labels,
)
from cpfls_cli.evolution.ranking import rank
from cpfls_cli.evolution.settings import EvolutionSettings
from cpfls_cli.result import about
from cpfls_cli.rounding import at_most

End = Literal["generations", "converged"]


@dataclass(frozen=True, eq=False)
class History:
    """Course of the search, one row for each generation from the initial population on."""

    evaluations: IntArray = about("chromosomes evaluated so far", "generation", brief=False)
    best: Array = about(
        "best of each objective so far; infinite where none had a value",
        "generation",
        "3",
        unit="SI",
        gaps=True,
        brief=False,
    )
    front_size: IntArray = about("members of the Pareto front so far", "generation", brief=False)

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
    """Report a population after one generation, of which 0 is the initial population.

    Genes are as the evaluator refined them; objectives are to be minimised, +inf where it gave no finite value;
    evaluations count each chromosome once; the front holds the non-dominated chromosomes among all ever evaluated.
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


def ended(state: EvolutionState, settings: EvolutionSettings) -> End | None:
    """Tell why an evolution has reached its end; None where another generation is to be bred."""
    if state.index >= settings.generations:
        return "generations"
    return "converged" if stalled(state.history, settings.stall_generations, settings.stall_improvement) else None


def stalled(history: History, generations: int | None, improvement: float) -> bool:
    """Tell whether the best of no objective improved enough over the last generations; never for None of them.

    Not enough is ``best_before - best_now <= improvement * |best_before|`` for every objective. An objective that got
    its first finite value improved, and a history that is shorter is not stalled.
    """
    if generations is None or len(history) <= generations:
        return False
    before, now = history.best[-1 - generations], history.best[-1]
    known = np.isfinite(before)
    if np.any(np.isfinite(now[~known])):
        return False
    size = np.abs(before[known])
    return bool(np.all(at_most(before[known] - now[known], improvement * size, size)))


def evolve(
    evaluate: Evaluate,
    gene_count: int,
    settings: EvolutionSettings,
    rng: np.random.Generator,
    initial: IntArray | None = None,
) -> Iterator[Generation]:
    """Search for non-dominated chromosomes, one generation at a time.

    `evaluate` takes chromosomes, shape (n, genes), 16 bits each, never seen before, and returns their `Evaluation`. It
    may rewrite them (Lamarckian local search); the rewritten genes take their place. `initial`: chromosomes to start
    with; the rest of the initial population, which comes first, is random. `ComputationError` where they, or the
    evaluator's result, do not fit. Paper, section 9; method.md section 7.
    """
    state = start(evaluate, gene_count, settings, rng, initial)
    yield state.report()
    while ended(state, settings) is None:
        state = step(state, evaluate, settings)
        yield state.report()


def start(
    evaluate: Evaluate,
    gene_count: int,
    settings: EvolutionSettings,
    rng: np.random.Generator,
    initial: IntArray | None = None,
) -> EvolutionState:
    """Evaluate the initial population; the parameters are those of `evolve`."""
    genes = rng.integers(0, 2**BITS_PER_GENE, size=(settings.population, gene_count), dtype=np.int64)
    if initial is not None:
        if initial.ndim != 2 or initial.shape[1] != gene_count or len(initial) > len(genes):
            expected = f"(up to {len(genes)}, {gene_count})"
            raise ComputationError(f"initial: expected shape {expected}, got {initial.shape}")
        _require_range("initial", initial)
        genes[: len(initial)] = initial
    archive = Archive()
    evaluation = archive.evaluate(genes, _checked(evaluate))
    labels = subpopulation_labels(settings.population, settings.subpopulations)
    history = History.empty(evaluation.objectives.shape[1]).extended(archive)
    return EvolutionState(0, evaluation.genes, evaluation.objectives, labels, archive, history, rng)


def step(state: EvolutionState, evaluate: Evaluate, settings: EvolutionSettings) -> EvolutionState:
    """Breed one generation; the parameters are those of `evolve`.

    The next state shares the archive and the random generator with the given one, which is of no use for another step,
    also where the evaluation raises an error.
    """
    ranks = rank(state.objectives, settings.ranking, settings.first_objective_weight)
    broods = [_brood(group, ranks, state, settings) for group in members(state.subpopulations)]
    offspring_labels = np.repeat(np.arange(len(broods)), [len(brood) for brood in broods])
    offspring = state.archive.evaluate(np.concatenate(broods), _checked(evaluate))
    genes = np.concatenate([state.genes, offspring.genes])
    objectives = np.concatenate([state.objectives, offspring.objectives])
    kept = reinsert(
        genes,
        rank(objectives, settings.ranking, settings.first_objective_weight),
        state.subpopulations,
        offspring_labels,
        settings.insertion_rate,
        settings.reinsertion,
        state.rng,
    )
    index = state.index + 1
    if index % settings.migration_interval == 0:
        kept = kept[migrate(state.subpopulations, settings.migration_rate, state.rng)]
    history = state.history.extended(state.archive)
    return replace(state, index=index, genes=genes[kept], objectives=objectives[kept], history=history)


def _brood(group: IntArray, ranks: IntArray, state: EvolutionState, settings: EvolutionSettings) -> IntArray:
    """Breed the offspring of one subpopulation."""
    count = max(int(settings.generation_gap * len(group) + 0.5), 2)
    fitness = linear_ranking_fitness(ranks[group], settings.selective_pressure)
    parents = group[stochastic_universal_sampling(fitness, count, state.rng)]
    genes = state.genes[parents]
    if settings.recombination == "intermediate":
        drawn = intermediate_recombination(genes, settings.crossover_rate, 2**BITS_PER_GENE - 1, state.rng)
        bits = gray_encode(drawn)
    else:
        bits = single_point_crossover(gray_encode(genes), settings.crossover_rate, state.rng)
    return gray_decode(mutate(bits, settings.mutated_individuals, settings.mutated_bits, state.rng))


def _checked(evaluate: Evaluate) -> Evaluate:
    def evaluate_checked(genes: IntArray) -> Evaluation:
        evaluation = evaluate(genes)
        _require_range("evaluation.genes", evaluation.genes)
        return evaluation

    return evaluate_checked


def _require_range(name: str, genes: IntArray) -> None:
    if genes.size and (genes.min() < 0 or genes.max() >= 2**BITS_PER_GENE):
        raise ComputationError(
            f"{name}: expected genes from 0 to {2**BITS_PER_GENE - 1}, got {genes.min()} to {genes.max()}"
        )
