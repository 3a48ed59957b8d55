"""The default study with a comment on every key: the reference of the config."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from types import MappingProxyType
from typing import Any, Final

from cpfls_cli.config.keys import Choice, Key, keys_of
from cpfls_cli.config.resolved import resolved
from cpfls_cli.config.study import Study
from cpfls_cli.config.yaml_text import parse_yaml, to_yaml

_WIDTH = 110
_EXAMPLES: Final = MappingProxyType(
    {
        "signals": (
            "attitude: {columns: [roll, pitch, yaw], unit: deg}",
            "body_torque: {columns: [mx, my, mz], unit: N mm, sign: [1, -1, -1]}",
        )
    }
)


def commented_default() -> str:
    """Write the default study as YAML with comments on every key: what it is, and what values it may have."""
    return "\n".join(_commented(Study, resolved(Study()), 0)) + "\n"


def _commented(settings: type, data: dict[str, Any], depth: int) -> Iterator[str]:
    indent = "  " * depth
    for key in keys_of(settings):
        value = data[key.name]
        if key.section is not None and isinstance(value, dict) and set(value) == {k.name for k in keys_of(key.section)}:
            yield f"{indent}{key.name}:  # {key.doc}" if key.doc else f"{indent}{key.name}:"
            yield from _commented(key.section, value, depth + 1)
            continue
        yield from (f"{indent}# {line}" for line in _comment(key))
        yield from (indent + line for line in to_yaml({key.name: value}).rstrip("\n").split("\n"))


def _comment(key: Key) -> Iterator[str]:
    if key.doc:
        yield key.doc
    yield from _listed("one of", key.choices)
    yield from _listed("names:", key.entries)
    for below in keys_of(key.section) if key.section is not None else ():
        yield f"  {below.name}: {below.doc}"
        yield from (f"    {line}" for line in _listed("one of", below.choices))
    if key.name in _EXAMPLES:
        yield "example, to stand below the key instead of {}:"
        yield from (f"  {line}" for line in _EXAMPLES[key.name])


def _listed(words: str, values: Sequence[Choice]) -> list[str]:
    listed = ", ".join(map(_written, values))
    return textwrap.wrap(f"{words} {listed}", _WIDTH, break_on_hyphens=False) if values else []


def _written(value: Choice) -> str:
    """Write a value as it must stand in a config: text that reads as a number needs quotes."""
    if value is None:
        return "null"
    return str(value) if parse_yaml(str(value), "choices") == value else f"'{value}'"
