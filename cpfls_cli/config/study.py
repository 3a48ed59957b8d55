"""One study and its YAML: the settings of every section, read, validated together, written again, named in messages."""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field
from typing_extensions import Doc

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

_TAG = "tag:yaml.org,2002:"
_FLOAT = re.compile(r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$|^[-+]?\.(inf|Inf|INF)$|^\.(nan|NaN|NAN)$")
_MOST_VALUES = 100_000
_INT = re.compile(r"^[-+]?(0|[1-9][0-9]*)$")
_MOST_DIGITS = 400
"""More than a float holds, and fewer than Python converts."""


class _StudyLoader(yaml.SafeLoader):
    """A safe loader with YAML 1.2 numbers and booleans, no dates, no duplicate keys, and nothing that JSON lacks."""


_StudyLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag in {_TAG + "null", _TAG + "merge"}]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_StudyLoader.yaml_constructors = {
    tag: construct
    for tag, construct in yaml.SafeLoader.yaml_constructors.items()
    if tag is None or tag.removeprefix(_TAG) in {"null", "bool", "int", "float", "str", "seq", "map"}
}
_StudyLoader.add_implicit_resolver(_TAG + "int", _INT, list("-+0123456789"))
_StudyLoader.add_implicit_resolver(_TAG + "float", _FLOAT, list("-+0123456789."))
_StudyLoader.add_implicit_resolver(_TAG + "bool", re.compile(r"^(true|True|TRUE|false|False|FALSE)$"), list("tTfF"))


def _mapping_without_duplicates(loader: _StudyLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    loader.flatten_mapping(node)
    mapping: dict[Any, Any] = {}
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, str):
            raise yaml.constructor.ConstructorError(None, None, f"key {key!r} is not text", key_node.start_mark)
        if key in mapping:
            raise yaml.constructor.ConstructorError(None, None, f"key '{key}' appears twice", key_node.start_mark)
        mapping[key] = loader.construct_object(value_node, deep=True)
    return mapping


def _whole_number(loader: _StudyLoader, node: yaml.ScalarNode) -> int:
    if len(node.value) > _MOST_DIGITS:
        raise yaml.constructor.ConstructorError(None, None, f"a number of {len(node.value)} digits", node.start_mark)
    return int(loader.construct_yaml_int(node))


_StudyLoader.add_constructor(_TAG + "int", _whole_number)
_StudyLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping_without_duplicates)


def parse_yaml(text: str, source: str) -> Any:
    """Parse one YAML document into dict, list, str, int, float, bool and None."""
    try:
        return deepcopy(_parsed(text))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        raise ConfigError(f"{source}{where}: not valid YAML: {error.problem}") from None
    except RecursionError:
        raise ConfigError(f"{source}: lists or mappings are nested deeper than in any config") from None
    except (yaml.YAMLError, ValueError, LookupError, TypeError, ArithmeticError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise ConfigError(f"{source}: not valid YAML: {reason}") from None


@lru_cache(maxsize=8)
def _parsed(text: str) -> Any:
    """Parse a document once: the artifacts that a command reads and writes mostly hold one and the same config."""
    loader = _StudyLoader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        _written_out(node, {})
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _written_out(node: yaml.Node, known: dict[int, int]) -> int:
    """Count the values of a document with every alias written out; a node that is being counted counts 0."""
    if id(node) in known:
        if not known[id(node)]:
            raise yaml.constructor.ConstructorError(None, None, "an anchor that holds itself", node.start_mark)
        return known[id(node)]
    known[id(node)] = 0
    count = 1
    if isinstance(node, yaml.ScalarNode):
        if any("\ud800" <= character <= "\udfff" for character in node.value):
            problem = f"{node.value[:40]!r} holds half a character"
            raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark)
    else:
        # The entries of a mapping are pairs.
        inner = (part for entry in node.value for part in (entry if isinstance(entry, tuple) else (entry,)))
        count += sum(_written_out(part, known) for part in inner)
    if count > _MOST_VALUES:
        problem = f"more than {_MOST_VALUES} values with every alias written out"
        raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark)
    known[id(node)] = count
    return count


def to_yaml(data: Any) -> str:
    """Write plain data, as `parse_yaml` gives them, as YAML with keys in their given order."""
    return str(yaml.dump(data, Dumper=_StudyDumper, sort_keys=False, default_flow_style=False, width=100))


class _StudyDumper(yaml.SafeDumper):
    """Writes short lists on one line and floats that read back as floats."""


def _represent_list(dumper: _StudyDumper, data: list[Any]) -> yaml.Node:
    flat = not any(isinstance(item, dict | list) for item in data)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=flat)


_StudyDumper.add_representer(list, _represent_list)
# Text such as 1e-3 is quoted, because the loader above takes it for a number.
_StudyDumper.add_implicit_resolver(_TAG + "float", _FLOAT, list("-+0123456789."))


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


SECTIONS = tuple(field.alias or name for name, field in Study.model_fields.items() if name != "seed")
"""The sections of a config, in the order of the pipeline."""


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
