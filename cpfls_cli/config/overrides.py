"""Overrides from the command line: ``section.key=value``, the value read as YAML."""

from __future__ import annotations

import copy
from typing import Any

from cpfls_cli.config.resolved import resolved
from cpfls_cli.config.study import Study
from cpfls_cli.config.yaml_text import parse_yaml
from cpfls_cli.errors import ConfigError, SettingError

_MALFORMED = "write section.key=value"


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
    try:
        if not separator:
            raise SettingError(key, _MALFORMED)
        override_key(data, key.strip(), parse_yaml(text, f"--set {key}"))
    except SettingError as error:
        raise ConfigError(f"--set {override}: {error}") from None


def override_key(data: dict[str, Any], key: str, value: Any) -> None:
    """Put the value of one key into the data of a config.

    Parameters
    ----------
    data : dict
        Changed in place. A list that the config leaves out is taken from the default study.
    key : str
        With dots; an entry of a list is named by its index, from 0.

    Raises
    ------
    SettingError
        If the key is malformed, or leads below a single value or past the end of a list.
    """
    parts = key.split(".")
    if not all(parts):
        raise SettingError(key, _MALFORMED)
    *parents, last = parts
    place: Any = data
    default: Any = resolved(Study())
    for parent in parents:
        default = default.get(parent) if isinstance(default, dict) else None
        place = _enter(place, parent, default, key)
    if isinstance(place, list):
        place[_index(place, last, key)] = value
    elif isinstance(place, dict):
        place[last] = value
    else:
        raise SettingError(key, f"'{'.'.join(parents)}' is a single value and has no keys")


def _enter(place: Any, name: str, default: Any, key: str) -> Any:
    if isinstance(place, list):
        return place[_index(place, name, key)]
    if not isinstance(place, dict):
        raise SettingError(key, f"'{name}' lies below a single value")
    if place.get(name) is None:
        place[name] = copy.deepcopy(default) if isinstance(default, list) else {}
    return place[name]


def _index(place: list[Any], name: str, key: str) -> int:
    if not name.isdecimal() or int(name) >= len(place):
        raise SettingError(key, f"'{name}' is not an index of a list of {len(place)}, which count from 0")
    return int(name)
