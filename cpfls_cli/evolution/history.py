"""The course of an evolution: what was evaluated and reached after each generation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.archive import Archive


@dataclass(frozen=True)
class History:
    """Course of the search, one row for each generation from the initial population on.

    Attributes
    ----------
    evaluations : array of int, shape (generations + 1,)
        Chromosomes evaluated so far.
    best : array, shape (generations + 1, objectives)
        Best of each objective so far; +inf where none had a finite value.
    front_size : array of int, shape (generations + 1,)
        Members of the Pareto front so far.
    """

    evaluations: IntArray
    best: Array
    front_size: IntArray

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.evaluations)

    @classmethod
    def empty(cls, objectives: int) -> History:
        """Begin a history of so many objectives."""
        none = np.empty(0, dtype=np.int64)
        return cls(none, np.empty((0, objectives)), none)

    def extended(self, archive: Archive) -> History:
        """Add what has been evaluated by now.

        Parameters
        ----------
        archive : Archive
            Holds one evaluation at least.

        Returns
        -------
        History
            With one more row.
        """
        front = archive.front.objectives
        # The front holds the smallest value of every objective, so the rest of the archive is not needed.
        return History(
            np.append(self.evaluations, len(archive)),
            np.concatenate([self.best, front.min(axis=0, keepdims=True)]),
            np.append(self.front_size, len(front)),
        )
