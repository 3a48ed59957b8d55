"""Sweeps read from their artifacts, setting by setting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.pages.source import Source
from cpfls_cli.pages.swept_setting import SweptSetting
from cpfls_cli.pages.table_5 import PRINTED, PrintedColumn

_MEASURES = ("seed", "evaluations", "mse", "max_error", "relative_error", "condition_number")


@dataclass(frozen=True)
class Sweep:
    """Sweeps of the same settings with different seeds, taken as one.

    Attributes
    ----------
    sources : tuple of Source
        At least one.
    """

    sources: tuple[Source, ...]

    @property
    def label(self) -> str:
        """File names."""
        return " and ".join(source.label for source in self.sources)

    @property
    def parts(self) -> list[str]:
        """What models are judged on; the training part first."""
        return self.sources[0].artifact.texts("part")

    @property
    def complete(self) -> bool:
        """Whether every run is finished."""
        return all(source.artifact.number("complete") for source in self.sources)

    @property
    def planned_seeds(self) -> int:
        """Runs of each setting when all are finished."""
        return sum(int(source.config["sweep"]["seeds"]) for source in self.sources)

    @cached_property
    def settings(self) -> list[SweptSetting]:
        """The settings with their runs, in the order of the config."""
        names = self.sources[0].artifact.texts("setting/name")
        return [self._setting(name, place) for place, name in enumerate(names)]

    def _setting(self, name: str, place: int) -> SweptSetting:
        artifact = self.sources[0].artifact
        samples, population, generations = (
            int(artifact.array(f"setting/{key}")[place]) for key in ("samples", "population", "generations")
        )
        seeds, evaluations, *measured = (self._by_run(key, place) for key in _MEASURES)
        return SweptSetting(
            name,
            artifact.texts("setting/structure")[place],
            artifact.texts("setting/criterion")[place],
            samples,
            population,
            generations,
            seeds.astype(int),
            evaluations.astype(int),
            *measured,
        )

    def _by_run(self, key: str, place: int) -> Array:
        artifacts = [source.artifact for source in self.sources]
        return np.concatenate([a.array(f"run/{key}")[a.array("run/setting").astype(int) == place] for a in artifacts])


def joined_sweeps(sweeps: Sequence[Source]) -> list[Sweep]:
    """Take sweeps of equal settings and inputs as one, unless a seed stands in both.

    Returns
    -------
    list of Sweep
        In the order of the first of each.
    """
    joined: list[Sweep] = []
    for source in sweeps:
        place = next((place for place, sweep in enumerate(joined) if _goes_with(source, sweep)), None)
        if place is None:
            joined.append(Sweep((source,)))
        else:
            joined[place] = Sweep((*joined[place].sources, source))
    return joined


def _goes_with(source: Source, sweep: Sweep) -> bool:
    taken = {int(seed) for other in sweep.sources for seed in other.artifact.array("run/seed")}
    seeds = {int(seed) for seed in source.artifact.array("run/seed")}
    return _identity(source) == _identity(sweep.sources[0]) and not taken & seeds


def _identity(source: Source) -> tuple[object, ...]:
    """Tell what a sweep does apart from its seeds: inputs, parts, and every column of its table of settings."""
    artifact = source.artifact
    inputs = tuple(sorted((role, file.sha256) for role, file in artifact.header.inputs.items()))
    texts = ("part", "setting/name", "setting/overrides", "setting/structure", "setting/selection")
    numbers = ("setting/samples", "setting/population", "setting/generations")
    columns = [*(artifact.texts(key) for key in texts), *(artifact.array(key).tolist() for key in numbers)]
    return inputs, tuple(tuple(column) for column in columns)


def printed_beside(settings: list[SweptSetting]) -> list[PrintedColumn | None]:
    """Find the column of the paper that each setting repeats.

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
    """Tell whether sweeps repeat any column of the paper."""
    return any(column for sweep in joined_sweeps(sweeps) for column in printed_beside(sweep.settings))


def _fits(setting: SweptSetting, column: PrintedColumn, exact: bool) -> bool:
    keys = ("structure", "samples", "population", "generations") if exact else ("structure", "samples")
    return all(getattr(setting, key) == getattr(column, key) for key in keys)
