"""Database of all evaluated chromosomes, so that none is evaluated twice, and their ranking."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar, cast

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.settings import Ranking
from cpfls_cli.rounding import levelled


def comparable(objectives: Array) -> Array:
    """Give objectives that compare alike on every machine: the worst where not finite, and one value to those tied.

    Parameters
    ----------
    objectives : array, shape (individuals, objectives)
    """
    return np.stack([levelled(cost) for cost in worst_where_not_finite(objectives).T], axis=1)


def worst_where_not_finite(objectives: Array) -> Array:
    """Replace every objective that is not finite, NaN too, by +inf, so that every comparison is defined."""
    return np.where(np.isfinite(objectives), objectives, np.inf)


def pareto_front(objectives: Array) -> IntArray:
    """Find the non-dominated individuals, in increasing order; of equal objectives only the first is kept."""
    costs = comparable(objectives)
    front = []
    # In lexicographic order nobody is dominated by a later one, so the first of the remaining is always kept.
    remaining = np.lexsort(costs.T[::-1])
    while remaining.size:
        front.append(remaining[0])
        remaining = remaining[np.any(costs[remaining] < costs[remaining[0]], axis=1)]
    return np.sort(np.array(front, dtype=np.int64))


def rank(objectives: Array, method: Ranking, first_weight: int = 1) -> IntArray:
    """Rank individuals by the method of this name; smaller is better.

    Quantity dominance sums, over the population, the components in which others are better minus those in which they
    are worse, ``rank_i = sum_j sum_k w_k sign(f_ik - f_jk)``: a Borda count, which sums to zero over the population,
    with ties counted zero. The first objective may weigh more there (`first_weight`), where all are 1 in the paper. The
    Pareto count ("block-type") is one more than the number of individuals that dominate. Pareto fronts ("slice-type")
    are sorted out one after the other, and each gives its number. Objectives are to be minimised; one that is not
    finite counts as worse than every finite one. Under each method a dominating individual ranks before the dominated
    one. Paper, section 6, after its references [6], [5] and [4]; method.md section 7.
    """
    costs = comparable(objectives)
    if method == "quantity-dominance":
        return _quantity_dominance(costs, first_weight)
    dominates = _dominance(costs)
    if method == "pareto-count":
        return 1 + np.asarray(np.count_nonzero(dominates, axis=0))
    return _front_numbers(dominates)


def _quantity_dominance(costs: Array, first_weight: int) -> IntArray:
    """Sum the signs of the differences: the positions among the sorted population tell them, so it costs n log n."""
    # With ties averaged, position p of n has (smaller - larger) = 2 p - (n + 1), a whole number.
    signs = np.column_stack([2.0 * positions(cost) - (len(costs) + 1) for cost in costs.T]).astype(np.int64)
    signs[:, 0] *= first_weight
    ranks: IntArray = signs.sum(axis=1)
    return ranks


def _dominance(costs: Array) -> BoolArray:
    """Tell which individual (row) dominates which: nowhere worse, and better in one objective at least."""
    nowhere_worse = np.ones((len(costs), len(costs)), dtype=np.bool_)
    for cost in costs.T:
        nowhere_worse &= cost[:, np.newaxis] <= cost
    return nowhere_worse & ~nowhere_worse.T


def _front_numbers(dominates: BoolArray) -> IntArray:
    """Give the fronts their numbers: one for the non-dominated, two for those that are it without these, and so on."""
    dominating = np.count_nonzero(dominates, axis=0)
    ranks = np.zeros(len(dominates), dtype=np.int64)
    front = 0
    while not np.all(ranks):
        front += 1
        members = (dominating == 0) & (ranks == 0)
        ranks[members] = front
        dominating = dominating - np.count_nonzero(dominates[members], axis=0)
    return ranks


def positions(values: Array | IntArray) -> Array:
    """Give each value its position from 1 on among the sorted values, equal ones the mean of theirs.

    Without NaN; infinite values of one sign are equal.
    """
    # scipy.stats.rankdata does the same, but its import takes longer than the rest of the start.
    _, inverse, count = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(count) - 0.5 * (count - 1))[inverse])


@dataclass(frozen=True)
class Evaluation:
    """Result of evaluating chromosomes.

    Parameters
    ----------
    genes : array of int, shape (individuals, genes)
        The chromosomes, as rewritten by a local search; unchanged where there is none.
    objectives : array, shape (individuals, objectives)
        Objectives of these chromosomes, to be minimised. Not finite means that the objective has no value, and
        counts as worse than every finite one.
    """

    genes: IntArray
    objectives: Array


_Block = TypeVar("_Block", Array, IntArray)

Evaluate = Callable[[IntArray], Evaluation]


class Archive:
    """Remember each chromosome with its refined genes and objectives.

    A chromosome that a local search rewrote is known by what it was and by what it became. One row is kept for
    each evaluation, in order; objectives that are not finite are kept as +inf.
    """

    def __init__(self) -> None:
        self._row_of: dict[bytes, int] = {}
        self._submitted: list[IntArray] = []
        self._genes: list[IntArray] = []
        self._objectives: list[Array] = []
        self._count = 0
        self._front = np.empty(0, dtype=np.int64)

    @classmethod
    def of(cls, submitted: IntArray, evaluation: Evaluation) -> Archive:
        """Rebuild an archive from its `submitted` and `results`: it knows, gives and counts the same."""
        archive = cls()
        archive.store(submitted, evaluation)
        return archive

    def __len__(self) -> int:
        """Count the evaluations."""
        return self._count

    @property
    def submitted(self) -> IntArray:
        """Chromosomes as they were evaluated, shape (evaluations, genes)."""
        return _whole(self._submitted)

    @property
    def results(self) -> Evaluation:
        """Refined genes and objectives of all evaluations; with `submitted`, all that `of` needs."""
        return Evaluation(_whole(self._genes), _whole(self._objectives))

    @property
    def front(self) -> Evaluation:
        """Non-dominated chromosomes among all ever evaluated, equal vectors of objectives once."""
        return self._rows(self._front)

    def evaluate(self, genes: IntArray, evaluate: Evaluate) -> Evaluation:
        """Evaluate the chromosomes that are not known yet, and recall the others.

        Parameters
        ----------
        genes : array of int, shape (individuals, genes)
        evaluate : callable
            Called once with the unknown chromosomes, each once, in order of appearance; not called for none.

        Raises
        ------
        ComputationError
            If the evaluator's result does not fit the chromosomes it was given.
        """
        first_of = {key: row for row, key in reversed(list(enumerate(map(_key, genes))))}
        unknown = sorted(row for key, row in first_of.items() if key not in self._row_of)
        if unknown:
            self.store(genes[unknown], evaluate(genes[unknown].copy()))
        return self._rows([self._row_of[_key(chromosome)] for chromosome in genes])

    def store(self, submitted: IntArray, evaluation: Evaluation) -> None:
        """Add evaluated chromosomes.

        Parameters
        ----------
        submitted : array of int, shape (individuals, genes)
            Chromosomes as they were before the evaluation.
        evaluation : Evaluation
            What they became, and their objectives.

        Raises
        ------
        ComputationError
            If the evaluation does not fit the chromosomes.
        """
        if evaluation.genes.shape != submitted.shape or not np.issubdtype(evaluation.genes.dtype, np.integer):
            raise ComputationError(
                f"evaluation.genes: expected integers of shape {submitted.shape}, "
                f"got {evaluation.genes.dtype} of shape {evaluation.genes.shape}"
            )
        if evaluation.objectives.ndim != 2 or len(evaluation.objectives) != len(submitted):
            raise ComputationError(
                f"evaluation.objectives: expected shape ({len(submitted)}, objectives), "
                f"got {evaluation.objectives.shape}"
            )
        first_row = self._count
        self._count += len(submitted)
        self._submitted.append(np.array(submitted, dtype=np.int64))
        self._genes.append(np.array(evaluation.genes, dtype=np.int64))
        self._objectives.append(worst_where_not_finite(evaluation.objectives))
        self._register(self._submitted[-1], first_row)
        self._register(self._genes[-1], first_row)
        candidates = np.append(self._front, np.arange(first_row, self._count))
        self._front = candidates[pareto_front(self._rows(candidates).objectives)]

    def _register(self, chromosomes: IntArray, first_row: int) -> None:
        for row, chromosome in enumerate(chromosomes, start=first_row):
            self._row_of.setdefault(_key(chromosome), row)

    def _rows(self, rows: IntArray | list[int]) -> Evaluation:
        return Evaluation(_whole(self._genes)[rows], _whole(self._objectives)[rows])


def _whole(blocks: list[_Block]) -> _Block:
    """Join the stored blocks to one array, and keep it in their place."""
    if len(blocks) > 1:
        blocks[:] = [cast(_Block, np.concatenate(blocks))]
    return blocks[0]


def _key(chromosome: IntArray) -> bytes:
    return np.asarray(chromosome, dtype=np.int64).tobytes()
