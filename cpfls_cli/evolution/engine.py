"""The genetic algorithm: its state, history and end; operators; breed, evaluate, reinsert, migrate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.archive import Archive, Evaluate, Evaluation, positions, rank
from cpfls_cli.evolution.settings import EvolutionSettings, Reinsertion
from cpfls_cli.result import about
from cpfls_cli.rounding import at_most

BITS_PER_GENE = 16
# Share of the distance between two parents by which offspring may lie beyond them.
_BEYOND = 0.25


def gray_encode(genes: IntArray, bits_per_gene: int = BITS_PER_GENE) -> BoolArray:
    """Write genes as reflected Gray code, ``g XOR (g >> 1)``, most significant bit first.

    Neighbouring integers differ in one bit; shape (individuals, genes * bits_per_gene).
    """
    code = genes ^ (genes >> 1)
    bits = (code[..., np.newaxis] >> _shifts(bits_per_gene)) & 1
    return bits.astype(np.bool_).reshape(len(genes), -1)


def gray_decode(bits: BoolArray, bits_per_gene: int = BITS_PER_GENE) -> IntArray:
    """Read genes from reflected Gray code, as BS2RV of the Sheffield toolbox does with integer bounds."""
    code = bits.reshape(len(bits), bits.shape[1] // bits_per_gene, bits_per_gene)
    binary = np.logical_xor.accumulate(code, axis=-1)
    genes: IntArray = (binary.astype(np.int64) << _shifts(bits_per_gene)).sum(axis=-1)
    return genes


def _shifts(bits_per_gene: int) -> IntArray:
    return np.arange(bits_per_gene, dtype=np.int64)[::-1]


def linear_ranking_fitness(ranks: IntArray, selective_pressure: float) -> Array:
    """Assign fitness linear in the position among the sorted ranks (RANKING of the Sheffield toolbox), with mean 1.

    ``2 - SP + 2 (SP - 1) (position - 1) / (individuals - 1)``, where position 1 is the least fit and SP, the selective
    pressure, goes from 1 (all equal) to 2 (the least fit gets nothing). Smaller ranks are better, of two individuals at
    least; equal ones share the mean of their positions.
    """
    slope = 2.0 * (selective_pressure - 1.0) / (len(ranks) - 1)
    fitness: Array = 2.0 - selective_pressure + slope * (positions(-ranks) - 1.0)
    return fitness


def stochastic_universal_sampling(fitness: Array, count: int, rng: np.random.Generator) -> IntArray:
    """Choose parents with one spin of a wheel with equally spaced pointers (SUS of the Sheffield toolbox).

    Fitness is not negative, with a positive sum. Indices are in random order; an individual occurs ``count * fitness /
    sum(fitness)`` times, rounded down or up.
    """
    wheel = np.cumsum(fitness)
    pointers = wheel[-1] * (rng.random() + np.arange(count)) / count
    chosen = np.searchsorted(wheel, pointers, side="right")
    # Rounding may put the last pointer on the end of the wheel.
    return rng.permutation(np.minimum(chosen, len(fitness) - 1))


def intermediate_recombination(genes: IntArray, rate: float, largest: int, rng: np.random.Generator) -> IntArray:
    """Draw offspring between the parents of consecutive pairs and a little beyond (RECINT of the Sheffield toolbox).

    ``offspring = first + u (second - first)``, u uniform from -0.25 to 1.25 for each gene of each offspring, clipped to
    0 and the largest; a pair of rows is recombined with the probability `rate`, an odd last row stays as it is.
    Mühlenbein and Schlierkamp-Voosen, Evolutionary Computation 1 (1993): extended intermediate recombination.
    """
    paired = 2 * (len(genes) // 2)
    recombined = np.repeat(rng.random(paired // 2) < rate, 2)
    share = rng.uniform(-_BEYOND, 1.0 + _BEYOND, size=(paired, genes.shape[1]))
    partner = genes[:paired].reshape(-1, 2, genes.shape[1])[:, ::-1].reshape(paired, -1)
    drawn = np.rint(genes[:paired] + share * (partner - genes[:paired])).astype(np.int64)
    offspring = genes.copy()
    offspring[:paired][recombined] = np.clip(drawn, 0, largest)[recombined]
    return offspring


def single_point_crossover(bits: BoolArray, rate: float, rng: np.random.Generator) -> BoolArray:
    """Exchange the tails of consecutive pairs, with the probability `rate` (XOVSP of the Sheffield toolbox).

    Each crossed pair of rows keeps at least the first bit and exchanges at least the last; an odd last row stays as it
    is.
    """
    individuals, length = bits.shape
    pairs = individuals // 2
    crossed = rng.random(pairs) < rate
    point = rng.integers(1, length, size=pairs) if length > 1 else np.ones(pairs, dtype=np.int64)
    tail = crossed[:, np.newaxis] & (np.arange(length) >= point[:, np.newaxis])
    first, second = bits[0 : 2 * pairs : 2], bits[1 : 2 * pairs : 2]
    offspring = bits.copy()
    offspring[0 : 2 * pairs : 2] = np.where(tail, second, first)
    offspring[1 : 2 * pairs : 2] = np.where(tail, first, second)
    return offspring


def mutate(bits: BoolArray, individuals_share: float, bits_share: float, rng: np.random.Generator) -> BoolArray:
    """Flip a share of the bits of a share of the individuals (MUT of the Sheffield toolbox, on some rows).

    Every individual and every bit is drawn on its own, so the shares are expectations and hold for small populations
    and short chromosomes too.
    """
    mutating = rng.random((len(bits), 1)) < individuals_share
    flipped = rng.random(bits.shape) < bits_share
    mutated: BoolArray = bits ^ (mutating & flipped)
    return mutated


def subpopulation_labels(population: int, subpopulations: int) -> IntArray:
    """Split a population as evenly as possible, by labels in increasing order; sizes differ by one at most."""
    return np.sort(np.arange(population, dtype=np.int64) % subpopulations)


def members(labels: IntArray) -> list[IntArray]:
    """List the individuals of each subpopulation, as indices into the population."""
    return [np.flatnonzero(labels == label) for label in np.unique(labels)]


def reinsert(
    genes: IntArray,
    ranks: IntArray,
    parent_labels: IntArray,
    offspring_labels: IntArray,
    rate: float,
    method: Reinsertion,
    rng: np.random.Generator,
) -> IntArray:
    """Replace parents by the fittest offspring of their subpopulation (REINS of the Sheffield toolbox).

    Genes and ranks (smaller is better) are of parents, then offspring; gives, for each place in the population, the
    index among them of who now takes it. `rate`: share of the offspring that is inserted, one at least and no more than
    there are parents. Uniform: replace parents drawn at random, so that even the best may be lost; fitness: the least
    fit. Elitist: the fittest of parents and these offspring stay, and of equal chromosomes only one, as long as there
    are others.
    """
    parents = len(parent_labels)
    source = np.arange(parents, dtype=np.int64)
    for old, new in zip(members(parent_labels), members(offspring_labels), strict=True):
        count = min(max(int(rate * len(new) + 0.5), 1), len(old))
        entering = parents + new[np.argsort(ranks[parents + new], kind="stable")][:count]
        if method == "elitist":
            source[old] = _fittest(np.append(old, entering), genes, ranks)[: len(old)]
            continue
        replaced = rng.permutation(old)
        if method == "fitness":
            replaced = replaced[np.argsort(-ranks[replaced], kind="stable")]
        source[replaced[:count]] = entering
    return source


def _fittest(candidates: IntArray, genes: IntArray, ranks: IntArray) -> IntArray:
    """Sort by rank, the first come first where it is equal, and copies of others behind all."""
    copied = np.ones(len(candidates), dtype=np.bool_)
    copied[np.unique(genes[candidates], axis=0, return_index=True)[1]] = False
    return candidates[np.lexsort((ranks[candidates], copied))]


def migrate(labels: IntArray, rate: float, rng: np.random.Generator) -> IntArray:
    """Exchange individuals over a complete net, chosen uniformly (MIGRATE of the Sheffield toolbox).

    Each subpopulation sends copies of individuals drawn at random to a pool, and replaces as many of its own, drawn at
    random too, by individuals from the pool of all the others. The number is the rounded-down share (`rate`) of the
    smallest subpopulation, at least one, so that subpopulations of unequal size exchange evenly; nobody moves at 0, or
    in a single one. Gives, for each place in the population, the index of the individual that now takes it.
    """
    source = np.arange(len(labels), dtype=np.int64)
    groups = members(labels)
    if rate == 0.0 or len(groups) == 1:
        return source
    # The small number keeps a product such as 0.29 * 100 from losing its last individual.
    count = max(int(rate * min(len(group) for group in groups) + 1e-9), 1)
    emigrants = [rng.choice(group, count, replace=False) for group in groups]
    for index, group in enumerate(groups):
        pool = np.concatenate(emigrants[:index] + emigrants[index + 1 :])
        source[rng.choice(group, count, replace=False)] = rng.choice(pool, count, replace=False)
    return source


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
