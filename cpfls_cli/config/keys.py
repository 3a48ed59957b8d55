"""The keys of a config, read from the settings classes, and the commented default that lists them all."""

from __future__ import annotations

import textwrap
import types
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin, get_type_hints

from typing_extensions import Doc

from cpfls_cli.config.study import Study, resolved
from cpfls_cli.config.yaml_text import parse_yaml, to_yaml

Choice = str | int | None
_ENTRIES = {tuple, list, dict, Mapping}
_UNIONS = {Union, types.UnionType}
_WIDTH = 110
_EXAMPLES: Final = MappingProxyType(
    {
        "signals": (
            "attitude: {columns: [roll, pitch, yaw], unit: deg}",
            "body_torque: {columns: [mx, my, mz], unit: N mm, sign: [1, -1, -1]}",
        )
    }
)


@dataclass(frozen=True)
class Key:
    """One key of a config.

    `section`: the settings class below it; `many`: whether it holds a list or a mapping of such; `choices`: the only
    values allowed; `entries`: names that the entries of a mapping may have. Empty where there are none.
    """

    name: str
    doc: str
    section: type | None
    many: bool
    choices: tuple[Choice, ...]
    entries: tuple[Choice, ...]


@cache
def keys_of(settings: type) -> tuple[Key, ...]:
    """List the keys of a settings class."""
    hints = get_type_hints(settings, include_extras=True)
    if settings is Study:
        names = {name: field.alias or name for name, field in Study.model_fields.items()}
    else:
        names = {field.name: field.name for field in fields(settings)}
    return tuple(_key(shown, hints[name]) for name, shown in names.items())


def _key(name: str, hint: Any) -> Key:
    return Key(name, _doc(hint), *_section(hint), _choices(hint) or (), _entries(hint))


def known_keys(location: Sequence[str], deep: bool = False) -> list[str]:
    """List the valid keys of a section, or the dotted paths of all below; names and indices of entries do not count."""
    settings: type | None = Study
    parts = iter(location)
    for part in parts:
        key = next((key for key in keys_of(settings) if key.name == part), None) if settings else None
        settings = key.section if key else None
        if key is not None and key.many and next(parts, None) is None:
            return []
    if settings is None:
        return []
    return list(_paths(settings)) if deep else [key.name for key in keys_of(settings)]


def _paths(settings: type, prefix: str = "") -> Iterator[str]:
    for key in keys_of(settings):
        yield prefix + key.name
        if key.section is not None:
            yield from _paths(key.section, f"{prefix}{key.name}.")


def _doc(hint: Any) -> str:
    if get_origin(hint) is not Annotated:
        return ""
    return next((note.documentation for note in get_args(hint)[1:] if isinstance(note, Doc)), "")


def _section(hint: Any, many: bool = False) -> tuple[type | None, bool]:
    """Find the settings class inside a hint such as ``Annotated[tuple[RotorSettings, ...], ...]``."""
    if is_dataclass(hint) and isinstance(hint, type):
        return hint, many
    origin = get_origin(hint)
    if origin is Annotated or origin in _UNIONS or origin in _ENTRIES:
        pairs = (_section(part, many or origin in _ENTRIES) for part in get_args(hint))
        return next((pair for pair in pairs if pair[0] is not None), (None, False))
    return None, False


def _choices(hint: Any) -> tuple[Choice, ...] | None:
    """Find the values of a hint such as ``Literal["s", "ms"] | None``; None where it allows others too."""
    origin = get_origin(hint)
    if origin is Literal:
        return get_args(hint)
    if hint is types.NoneType:
        return (None,)
    if origin is Annotated:
        return _choices(get_args(hint)[0])
    if origin not in _UNIONS:
        return None
    parts = [_choices(part) for part in get_args(hint)]
    return None if None in parts else tuple(value for part in parts if part for value in part)


def _entries(hint: Any) -> tuple[Choice, ...]:
    """Find the names that the entries of a mapping or a list may have."""
    if get_origin(hint) is Annotated:
        return _entries(get_args(hint)[0])
    return _choices(get_args(hint)[0]) or () if get_origin(hint) in {dict, Mapping, tuple} else ()


def commented_default() -> str:
    """Write the default study as YAML with a comment on every key: its meaning and the values that it may have."""
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
        yield "example, to write below the key instead of {}:"
        yield from (f"  {line}" for line in _EXAMPLES[key.name])


def _listed(words: str, values: Sequence[Choice]) -> list[str]:
    listed = ", ".join(map(_written, values))
    return textwrap.wrap(f"{words} {listed}", _WIDTH, break_on_hyphens=False) if values else []


def _written(value: Choice) -> str:
    """Write a value as it must stand in a config: text that reads as a number needs quotes."""
    if value is None:
        return "null"
    return str(value) if parse_yaml(str(value), "choices") == value else f"'{value}'"
