"""One study: the settings of every section, validated together, written out again, and named in messages."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from typing_extensions import Doc

from cpfls_cli.config.yaml_text import to_yaml
from cpfls_cli.errors import ConfigError, SettingError
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.reduction.settings import ReductionSettings
from cpfls_cli.settings import Settings
from cpfls_cli.simulation.settings import SimulationSettings
from cpfls_cli.trajectory.settings import TrajectorySettings
from cpfls_cli.vehicle.settings import VehicleSettings

SECTIONS = (
    "vehicle",
    "trajectory",
    "simulation",
    "import",
    "reduction",
    "identification",
    "gap",
    "playback",
    "report",
)
"""The sections of a config, in the order of the pipeline."""


@dataclass(frozen=True, kw_only=True)
class ReportSettings(Settings):
    """Settings of the report."""

    title: Annotated[str, Doc("heading of the page")] = "Identification of rotational dynamics"
    notes: Annotated[tuple[str, ...], Doc("what a reader should know about this study, one sentence each")] = ()


class Study(BaseModel):
    """All settings of one study, one attribute per section of the YAML config."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, populate_by_name=True)

    seed: Annotated[int, Field(ge=0, lt=2**63), Doc("seed of everything random in this study")] = 1
    vehicle: Annotated[VehicleSettings, Doc("the aircraft: mass, inertia, rotors")] = VehicleSettings()
    trajectory: Annotated[TrajectorySettings, Doc("the path that `cpfls trajectory` plans")] = TrajectorySettings()
    simulation: Annotated[SimulationSettings, Doc("what `cpfls simulate` adds")] = SimulationSettings()
    import_: Annotated[
        ImportSettings, Field(alias="import"), Doc("how `cpfls import` reads a log: columns, units, frames, filters")
    ] = ImportSettings()
    reduction: Annotated[ReductionSettings, Doc("which samples `cpfls reduce` keeps")] = ReductionSettings()
    identification: Annotated[IdentificationSettings, Doc("what `cpfls identify` fits and how it searches")] = (
        IdentificationSettings()
    )
    gap: Annotated[GapSettings, Doc("how `cpfls compare`, `diagnose`, `extend` and `gap` look for what is missing")] = (
        GapSettings()
    )
    playback: Annotated[PlaybackSettings, Doc("how `cpfls vehicle` fits a whole vehicle to what it predicts")] = (
        PlaybackSettings()
    )
    report: Annotated[ReportSettings, Doc("what `cpfls report` shows")] = ReportSettings()


def resolved(study: Study, sections: Sequence[str] = ()) -> dict[str, Any]:
    """Write a study as plain data with every default; of some sections or keys ``section.key`` those and the seed."""
    data: dict[str, Any] = study.model_dump(mode="json", by_alias=True)
    if not sections:
        return data
    kept: dict[str, Any] = {"seed": data["seed"]}
    for section in sections:
        _copy(section.split("."), data, kept, section)
    return kept


def _copy(keys: list[str], source: Any, target: dict[str, Any], asked: str) -> None:
    first, *rest = keys
    if not isinstance(source, dict) or first not in source:
        raise ConfigError(f"--section {asked}: no such section or key; the sections are {', '.join(SECTIONS)}")
    if rest:
        _copy(rest, source[first], target.setdefault(first, {}), asked)
    else:
        target[first] = source[first]


def resolved_yaml(study: Study, sections: Sequence[str] = ()) -> str:
    """Write a study as YAML with every default filled in."""
    return _written(json.dumps(resolved(study, sections)))


@lru_cache(maxsize=8)
def _written(data: str) -> str:
    """Write a study once: a search writes one and the same config into every checkpoint and into its artifact."""
    return to_yaml(json.loads(data))


@contextmanager
def settings_of(section: str, study: Study) -> Iterator[None]:
    """Name the config key and its value where the numerics refuse a setting that does not suit the data."""
    try:
        yield
    except SettingError as error:
        key = f"{section}.{error.key}"
        raise ConfigError(f"{key} = {json.dumps(_value(study, key))}: {error}") from None


def _value(study: Study, key: str) -> Any:
    value: Any = resolved(study, [key])
    for part in key.split("."):
        value = value[part]
    return value


def generator(study: Study, stage: str) -> np.random.Generator:
    """Make the random generator of a stage, so that stages draw independently of each other."""
    return np.random.default_rng([study.seed, zlib.crc32(stage.encode())])
