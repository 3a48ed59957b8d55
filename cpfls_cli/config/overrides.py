"""Overrides from the command line: ``section.key=value``, the value read as YAML."""

from __future__ import annotations

import copy
from typing import Any

from cpfls_cli.config.resolved import resolved
from cpfls_cli.config.study import Study
from cpfls_cli.config.yaml_text import parse_yaml
from cpfls_cli.errors import ConfigError


def apply_override(data: dict[str, Any], override: str) -> None:
    """Put one override into the data of a config.

    Parameters
    ----------
    data : dict
        Changed in place. A list that the config leaves out is taken from the default study.
    override : str
        ``section.key=value``; an entry of a list is named by its index, from 0.

    Raises
    ------
    ConfigError
        If the override is malformed, or leads below a single value or past the end of a list.
    """
    key, separator, text = override.partition("=")
    parts = key.strip().split(".")
    if not separator or not all(parts):
        raise ConfigError(f"--set {override}: write section.key=value")
    *parents, last = parts
    place: Any = data
    default: Any = resolved(Study())
    for parent in parents:
        default = default.get(parent) if isinstance(default, dict) else None
        place = _enter(place, parent, default, override)
    value = parse_yaml(text, f"--set {key}")
    if isinstance(place, list):
        place[_index(place, last, override)] = value
    elif isinstance(place, dict):
        place[last] = value
    else:
        raise ConfigError(f"--set {override}: '{'.'.join(parents)}' is a single value and has no keys")


def _enter(place: Any, name: str, default: Any, override: str) -> Any:
    if isinstance(place, list):
        return place[_index(place, name, override)]
    if not isinstance(place, dict):
        raise ConfigError(f"--set {override}: '{name}' lies below a single value")
    if place.get(name) is None:
        place[name] = copy.deepcopy(default) if isinstance(default, list) else {}
    return place[name]


def _index(place: list[Any], name: str, override: str) -> int:
    if not name.isdecimal() or int(name) >= len(place):
        raise ConfigError(f"--set {override}: '{name}' is not an index of a list of {len(place)}, which count from 0")
    return int(name)
