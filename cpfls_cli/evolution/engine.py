"""The genetic algorithm: breed, evaluate, reinsert, migrate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from cpfls_cli.arrays import IntArray
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
from cpfls_cli.evolution.state import EvolutionState, Generation, History, ended


def evolve(
    evaluate: Evaluate,
    gene_count: int,
    settings: EvolutionSettings,
    rng: np.random.Generator,
    initial: IntArray | None = None,
) -> Iterator[Generation]:
    """Search for non-dominated chromosomes, one generation at a time.

    Parameters
    ----------
    evaluate : callable
        Takes chromosomes, shape (n, genes), never seen before, and returns their `Evaluation`. It may rewrite
        them (Lamarckian local search); the rewritten genes take their place.
    gene_count : int
        Genes of a chromosome, 16 bits each.
    initial : array of int, shape (up to population, genes), optional
        Chromosomes to start with; the rest of the initial population is random.

    Yields
    ------
    Generation
        First the initial population, then one for each of ``settings.generations``, or up to convergence.

    Raises
    ------
    ComputationError
        If `initial` does not fit, or the evaluator's result does not fit the chromosomes.

    References
    ----------
    Paper, section 9; method.md section 7.
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
