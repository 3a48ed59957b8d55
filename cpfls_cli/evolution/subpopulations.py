"""Subpopulations that breed apart: their members, reinsertion of offspring into them, and migration between them."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.evolution.settings import Reinsertion


def subpopulation_labels(population: int, subpopulations: int) -> IntArray:
    """Split a population as evenly as possible.

    Returns
    -------
    array of int, shape (population,)
        Label of each individual's subpopulation, in increasing order; sizes differ by one at most.
    """
    return np.sort(np.arange(population, dtype=np.int64) % subpopulations)


def members(labels: IntArray) -> list[IntArray]:
    """List the individuals of each subpopulation.

    Parameters
    ----------
    labels : array of int, shape (population,)

    Returns
    -------
    list of array of int
        Indices into the population, one array per subpopulation.
    """
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

    Parameters
    ----------
    genes : array of int, shape (parents + offspring, genes)
        Chromosomes of parents, then offspring.
    ranks : array of int, shape (parents + offspring,)
        Their ranks, found together; smaller is better.
    parent_labels, offspring_labels : array of int, shape (parents,) and (offspring,)
        Subpopulation of each; both hold the same labels.
    rate : float
        Share of the offspring that is inserted, one at least and no more than there are parents.
    method : {"uniform", "fitness", "elitist"}
        Replace parents drawn at random, so that even the best may be lost, or the least fit. Elitist: the fittest of
        parents and these offspring stay, and of equal chromosomes only one, as long as there are others.

    Returns
    -------
    array of int, shape (parents,)
        For each place in the population, the index, among parents then offspring, of who now takes it.
    """
    parents = len(parent_labels)
    source = np.arange(parents, dtype=np.int64)
    for old, new in zip(members(parent_labels), members(offspring_labels), strict=True):
        count = min(max(int(rate * len(new) + 0.5), 1), len(old))
        entering = parents + new[np.argsort(ranks[parents + new], kind="stable")][:count]
        if method == "elitist":
            source[old] = _fittest(np.append(old, entering), genes, ranks)[: len(old)]
        else:
            source[_replaced(old, ranks, method, rng)[:count]] = entering
    return source


def _replaced(old: IntArray, ranks: IntArray, method: Reinsertion, rng: np.random.Generator) -> IntArray:
    shuffled = rng.permutation(old)
    if method == "uniform":
        return shuffled
    return shuffled[np.argsort(-ranks[shuffled], kind="stable")]


def _fittest(candidates: IntArray, genes: IntArray, ranks: IntArray) -> IntArray:
    """Sort by rank, the first come first where it is equal, and copies of others behind all."""
    copied = np.ones(len(candidates), dtype=np.bool_)
    copied[np.unique(genes[candidates], axis=0, return_index=True)[1]] = False
    return candidates[np.lexsort((ranks[candidates], copied))]


def migrate(labels: IntArray, rate: float, rng: np.random.Generator) -> IntArray:
    """Exchange individuals over a complete net, chosen uniformly (MIGRATE of the Sheffield toolbox).

    Each subpopulation sends copies of individuals drawn at random to a pool, and replaces as many of its own,
    drawn at random too, by individuals from the pool of all the others. The number is the rounded-down share of
    the smallest subpopulation, at least one, so that subpopulations of unequal size exchange evenly.

    Parameters
    ----------
    labels : array of int, shape (population,)
        Subpopulation of each individual.
    rate : float
        Share of a subpopulation that is replaced; nobody moves at 0, or in a single subpopulation.
    rng : numpy.random.Generator

    Returns
    -------
    array of int, shape (population,)
        For each place in the population, the index of the individual that now takes it.
    """
    source = np.arange(len(labels), dtype=np.int64)
    groups = members(labels)
    if rate == 0.0 or len(groups) == 1:
        return source
    count = _migrants(rate, min(len(group) for group in groups))
    emigrants = [rng.choice(group, count, replace=False) for group in groups]
    for index, group in enumerate(groups):
        pool = np.concatenate(emigrants[:index] + emigrants[index + 1 :])
        source[rng.choice(group, count, replace=False)] = rng.choice(pool, count, replace=False)
    return source


def _migrants(rate: float, size: int) -> int:
    # The small number keeps a product such as 0.29 * 100 from losing its last individual.
    return max(int(rate * size + 1e-9), 1)
