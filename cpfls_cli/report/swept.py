"""A sweep read from its artifact, setting by setting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.report.source import Source
from cpfls_cli.report.table_5 import PRINTED, PrintedColumn


@dataclass(frozen=True)
class SweptSetting:
    """One setting of a sweep.

    Attributes
    ----------
    name, structure : str
    samples, population, generations : int
    mse, max_error, relative_error : array, shape (runs, parts)
        Not finite where a run found no model.
    condition_number : array, shape (runs,)
    """

    name: str
    structure: str
    samples: int
    population: int
    generations: int
    mse: Array
    max_error: Array
    relative_error: Array
    condition_number: Array

    @property
    def runs(self) -> int:
        """Number of finished runs."""
        return len(self.condition_number)

    @property
    def best(self) -> int | None:
        """The run with the smallest mean squared error; None where no run found a model."""
        return int(np.nanargmin(self.mse[:, 0])) if np.isfinite(self.mse[:, 0]).any() else None

    def best_of(self, values: Array) -> float:
        """Pick the value of the best run."""
        return float("nan") if self.best is None else float(values[self.best])


def swept_settings(sweep: Source) -> list[SweptSetting]:
    """Read the settings of a sweep with their runs.

    Parameters
    ----------
    sweep : Source

    Returns
    -------
    list of SweptSetting
    """
    artifact = sweep.artifact
    setting = artifact.array("run/setting").astype(int)

    def whole(key: str, place: int) -> int:
        return int(artifact.array(f"setting/{key}")[place])

    def by_run(key: str, place: int) -> Array:
        return np.asarray(artifact.array(f"run/{key}")[setting == place])

    return [
        SweptSetting(
            name=name,
            structure=artifact.texts("setting/structure")[place],
            samples=whole("samples", place),
            population=whole("population", place),
            generations=whole("generations", place),
            mse=by_run("mse", place),
            max_error=by_run("max_error", place),
            relative_error=by_run("relative_error", place),
            condition_number=by_run("condition_number", place),
        )
        for place, name in enumerate(artifact.texts("setting/name"))
    ]


def printed_beside(settings: list[SweptSetting]) -> list[PrintedColumn | None]:
    """Find the column of the paper that each setting repeats.

    Parameters
    ----------
    settings : list of SweptSetting

    Returns
    -------
    list of PrintedColumn or None
        Of equal structure and samples; of those of equal population and generations too, else the first in order.
    """
    found: dict[int, PrintedColumn] = {}
    for exact in (True, False):
        for place, setting in enumerate(settings):
            free = (column for column in PRINTED if column not in found.values() and _fits(setting, column, exact))
            if place not in found and (column := next(free, None)) is not None:
                found[place] = column
    return [found.get(place) for place in range(len(settings))]


def repeats_table_5(sweeps: Sequence[Source]) -> bool:
    """Tell whether sweeps repeat any column of the paper.

    Parameters
    ----------
    sweeps : sequence of Source

    Returns
    -------
    bool
    """
    return any(column for sweep in sweeps for column in printed_beside(swept_settings(sweep)))


def _fits(setting: SweptSetting, column: PrintedColumn, exact: bool) -> bool:
    keys = ("structure", "samples", "population", "generations") if exact else ("structure", "samples")
    return all(getattr(setting, key) == getattr(column, key) for key in keys)
