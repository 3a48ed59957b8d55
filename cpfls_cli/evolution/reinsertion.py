"""Return of offspring into the population."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.evolution.settings import Reinsertion
from cpfls_cli.evolution.subpopulations import members


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
