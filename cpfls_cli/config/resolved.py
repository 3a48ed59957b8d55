"""A study written out again: resolved, whole or in parts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cpfls_cli.config.study import SECTIONS, Study
from cpfls_cli.config.yaml_text import to_yaml
from cpfls_cli.errors import ConfigError


def resolved(study: Study, sections: Sequence[str] = ()) -> dict[str, Any]:
    """Write a study as plain data with every default filled in.

    Parameters
    ----------
    sections : sequence of str
        Only these sections or single keys (``section.key``), and the seed; all if empty.

    Raises
    ------
    ConfigError
        If a section or key does not exist.
    """
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
    """Write a study as YAML with every default filled in.

    Parameters
    ----------
    study, sections
        See `resolved`.
    """
    return to_yaml(resolved(study, sections))
