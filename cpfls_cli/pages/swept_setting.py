"""One setting of a sweep with its runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array

ALL_SAMPLES = "all"
"""The criterion of a setting that learns from all samples."""


@dataclass(frozen=True)
class SweptSetting:
    """One setting of a sweep.

    Attributes
    ----------
    criterion : str
        What chose its samples; ``all`` where nothing did.
    seeds, evaluations : array of int, shape (runs,)
    mse, max_error, relative_error : array, shape (runs, parts)
        Not finite where a run found no model.
    condition_number : array, shape (runs,)
    """

    name: str
    structure: str
    criterion: str
    samples: int
    population: int
    generations: int
    seeds: Array
    evaluations: Array
    mse: Array
    max_error: Array
    relative_error: Array
    condition_number: Array

    @property
    def runs(self) -> int:
        """Number of finished runs."""
        return len(self.condition_number)

    @property
    def size(self) -> tuple[int, int]:
        """Population and generations."""
        return self.population, self.generations

    @property
    def best(self) -> int | None:
        """The run with the smallest mean squared error; None where no run found a model."""
        return int(np.nanargmin(self.mse[:, 0])) if np.isfinite(self.mse[:, 0]).any() else None

    def best_of(self, values: Array) -> float:
        """Pick the value of the best run."""
        return float("nan") if self.best is None else float(values[self.best])
