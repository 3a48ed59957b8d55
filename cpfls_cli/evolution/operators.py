"""Genetic operators: Gray coding, choice of parents, recombination, mutation, reinsertion and migration."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.evolution.ranking import positions
from cpfls_cli.evolution.settings import Reinsertion

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
