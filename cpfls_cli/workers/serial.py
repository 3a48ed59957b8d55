"""Evaluate in this process, one chromosome after the other."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.arrays import IntArray
from cpfls_cli.evolution.archive import Evaluate, Evaluation
from cpfls_cli.workers.chunks import chunks
from cpfls_cli.workers.workforce import Workforce


class Serial(Workforce):
    """The evaluator itself, row by row, so that it can be stopped between any two."""

    def __init__(self, evaluate: Evaluate) -> None:
        self._evaluate = evaluate

    def stream(self, genes: IntArray) -> Iterator[tuple[IntArray, Evaluation]]:
        """Evaluate chromosomes in order; parameters are those of `Workforce.stream`."""
        for rows in chunks(len(genes), max(len(genes), 1)):
            yield rows, self._evaluate(genes[rows])
