"""Database of all evaluated chromosomes, so that none is evaluated twice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar, cast

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import ComputationError
from cpfls_cli.evolution.ranking import pareto_front, worst_where_not_finite


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
