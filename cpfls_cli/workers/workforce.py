"""What all kinds of workers are to the genetic algorithm: an evaluator whose rows can be watched as they finish."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.evolution.archive import Evaluation


class Workforce(ABC):
    """Evaluate chromosomes somewhere.

    The evaluator must treat each chromosome by itself, whatever others it is given with. Then the result does not
    depend on the number or the kind of workers.
    """

    @abstractmethod
    def stream(self, genes: IntArray) -> Iterator[tuple[IntArray, Evaluation]]:
        """Evaluate chromosomes and hand out each part as soon as it is finished, in any order.

        Whoever stops iterating and closes the iterator gives up the rest: what has not begun is never begun, and
        what is under way is thrown away.

        Parameters
        ----------
        genes : array of int, shape (individuals, genes)

        Yields
        ------
        rows : array of int, shape (part,)
            Rows of `genes`; each appears once over all parts.
        evaluation : Evaluation
            Of these rows, in their order.

        Raises
        ------
        WorkerError
            If a worker vanishes or fails.
        ComputationError
            If the evaluator refuses its data.
        """

    def __call__(self, genes: IntArray) -> Evaluation:
        """Evaluate chromosomes and wait for all of them; the interface of an evaluator."""
        return gathered(list(self.stream(genes)))[1]


def gathered(parts: Sequence[tuple[IntArray, Evaluation]]) -> tuple[IntArray, Evaluation]:
    """Put evaluations in the order of their rows, whatever the order they came in.

    Parameters
    ----------
    parts : sequence of (array of int, Evaluation)
        Rows and their evaluation, at least one part; no row twice.

    Returns
    -------
    rows : array of int, shape (evaluations,)
        Ascending.
    evaluation : Evaluation
        In their order.
    """
    rows = np.concatenate([rows for rows, _ in parts])
    order = np.argsort(rows)
    genes = np.concatenate([evaluation.genes for _, evaluation in parts])
    objectives = np.concatenate([evaluation.objectives for _, evaluation in parts])
    return rows[order], Evaluation(genes[order], objectives[order])
