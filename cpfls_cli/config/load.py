"""Load a study config: read, override, validate, and report every error at once."""

from __future__ import annotations

import difflib
import json
from collections.abc import Sequence
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from cpfls_cli.config.keys import known_keys
from cpfls_cli.config.study import Study
from cpfls_cli.config.yaml_text import parse_yaml
from cpfls_cli.errors import ConfigError, SettingError

_UNKNOWN = {"extra_forbidden", "unexpected_keyword_argument"}


def load_study(path: Path, overrides: Sequence[str] = (), seed: int | None = None) -> Study:
    """Load and validate a study.

    Parameters
    ----------
    path : Path
        YAML file.
    overrides : sequence of str
        ``section.key=value`` each; the value is read as YAML.
    seed : int, optional
        Takes the place of the config's seed.

    Returns
    -------
    Study

    Raises
    ------
    ConfigError
        If the file cannot be read, is not YAML, or any key is wrong; all wrong keys are listed.
    """
    data = read_config(path)
    for override in overrides:
        _apply(data, override)
    if seed is not None:
        data["seed"] = seed
    return validate(data, str(path))


def read_config(path: Path) -> dict[str, Any]:
    """Read a config file as plain data.

    Parameters
    ----------
    path : Path

    Returns
    -------
    dict

    Raises
    ------
    ConfigError
        If the file cannot be read or does not hold a mapping.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot read the config: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file; a config is YAML in UTF-8") from None
    data = parse_yaml(text, str(path))
    if data is None:
        raise ConfigError(f"{path}: the config is empty; `cpfls config` prints a commented default")
    if not isinstance(data, dict):
        raise ConfigError(f"{path}: a config is a mapping of sections; this is a {type(data).__name__}")
    return data


def validate(data: dict[str, Any], source: str) -> Study:
    """Validate plain data as a study.

    Parameters
    ----------
    data : dict
    source : str
        Name of the file, for messages.

    Returns
    -------
    Study

    Raises
    ------
    ConfigError
        Listing every wrong key with its value, what is wrong, and the nearest valid key.
    """
    # A section that is named but left empty means its defaults.
    filled = {key: {} if value is None else value for key, value in data.items()}
    try:
        return Study.model_validate_json(json.dumps(filled))
    except ValidationError as error:
        lines = [_describe(detail, filled, source) for detail in error.errors()]
        raise ConfigError("\n".join(dict.fromkeys(lines))) from None


def _apply(data: dict[str, Any], override: str) -> None:
    key, separator, text = override.partition("=")
    if not separator or not key.strip():
        raise ConfigError(f"--set {override}: write section.key=value")
    *parents, last = key.strip().split(".")
    place: Any = data
    for parent in parents:
        place = _enter(place, parent, override)
    if isinstance(place, list):
        place[_index(place, last, override)] = parse_yaml(text, f"--set {key}")
    elif isinstance(place, dict):
        place[last] = parse_yaml(text, f"--set {key}")
    else:
        raise ConfigError(f"--set {override}: '{'.'.join(parents)}' is a single value and has no keys")


def _enter(place: Any, name: str, override: str) -> Any:
    if isinstance(place, list):
        return place[_index(place, name, override)]
    if not isinstance(place, dict):
        raise ConfigError(f"--set {override}: '{name}' lies below a single value")
    if place.get(name) is None:
        place[name] = {}
    return place[name]


def _index(place: list[Any], name: str, override: str) -> int:
    if not name.isdigit() or int(name) >= len(place):
        raise ConfigError(f"--set {override}: '{name}' is not an index of a list of {len(place)}")
    return int(name)


def _describe(detail: ErrorDetails, data: dict[str, Any], source: str) -> str:
    location = _location(detail)
    dotted = ".".join(location)
    value = _value(data, location)
    shown = f" = {value}" if value is not None else ""
    return f"{source}: {dotted}{shown}: {_reason(detail, location)}"


def _location(detail: ErrorDetails) -> list[str]:
    """Drop the parts of a location that name alternatives of a type, and add the key of a combination rule."""
    raw = [part for part in detail["loc"] if isinstance(part, int) or _is_key(str(part))]
    cause = detail.get("ctx", {}).get("error")
    return [str(part) for part in raw] + ([cause.key] if isinstance(cause, SettingError) else [])


def _is_key(part: str) -> bool:
    return not any(mark in part for mark in "[]() ,") and part not in {"int", "float", "str", "bool", "literal"}


def _value(data: Any, location: list[str]) -> str | None:
    for part in location:
        if isinstance(data, dict) and part in data:
            data = data[part]
        elif isinstance(data, list) and part.isdigit() and int(part) < len(data):
            data = data[int(part)]
        else:
            return None
    return None if isinstance(data, dict) or is_dataclass(data) else json.dumps(data)


def _reason(detail: ErrorDetails, location: list[str]) -> str:
    if detail["type"] in _UNKNOWN:
        return "unknown key" + _nearest(location)
    message = detail["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if detail["msg"].startswith("Input should be "):
        return f"must be {message}"
    return message


def _nearest(location: list[str]) -> str:
    keys = known_keys(location[:-1])
    near = difflib.get_close_matches(location[-1], keys, n=1, cutoff=0.5)
    if near:
        return f" (did you mean '{near[0]}'?)"
    elsewhere = [path for path in known_keys([], deep=True) if path.rsplit(".", 1)[-1] == location[-1]]
    if elsewhere:
        return f" (did you mean '{elsewhere[0]}'?)"
    return f" (valid here: {', '.join(keys)})" if keys else ""
