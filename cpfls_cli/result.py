"""Results that describe themselves: each field of a result is a dataset of its file and a key of its JSON.

Numerics return results. This module knows no file: `store` writes and reads results, `page` shows them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cache
from types import NoneType
from typing import Any, NamedTuple, TypeVar, dataclass_transform, get_args, get_origin, get_type_hints

import numpy as np

T = TypeVar("T")

AXES = {"axis": 3}
"""Axes of arrays whose name says their length."""


class About(NamedTuple):
    """What a value is.

    Attributes
    ----------
    text : str
        One line.
    axes : tuple of str
        Name of each axis of an array; two of one name in a result have one length.
    unit, frame : str
        ``1`` has no unit.
    gaps : bool
        Whether values may be missing: not finite.
    least : float
        Below which no value is.
    brief : bool
        Whether `--json` shows it too; what is not is in the file alone.
    """

    text: str
    axes: tuple[str, ...] = ()
    unit: str = "1"
    frame: str = "none"
    gaps: bool = False
    least: float = -np.inf
    brief: bool = True


def about(text: str, *axes: str, default: Any = MISSING, **more: Any) -> Any:
    """Describe a field; one with a default may be missing in a file."""
    return field(default=default, metadata={"about": About(text, axes, **more)})


def part(default: Any = MISSING) -> Any:
    """Make a field a result itself, a mapping from names to results, or a tuple of results: a table."""
    return field(default=default, metadata={"about": None})


@dataclass_transform(eq_default=False, kw_only_default=True, frozen_default=True, field_specifiers=(about, part))
def result(cls: type[T]) -> type[T]:
    """Make a class a result: frozen, its fields by keyword."""
    return dataclass(frozen=True, kw_only=True, eq=False)(cls)


class Described(NamedTuple):
    """A field of a result: its name, its type without None, what it is, and its default."""

    name: str
    kind: Any
    about: About | None
    default: Any

    @property
    def rows(self) -> Any:
        """Class of the rows of a table; None where it is none."""
        inner = get_args(self.kind)[:1]
        return inner[0] if get_origin(self.kind) is tuple and is_dataclass(inner[0]) else None


@cache
def described_fields(cls: Any) -> tuple[Described, ...]:
    """List the fields of a result that are written."""
    hints = get_type_hints(cls)
    return tuple(
        Described(each.name, _without_none(hints[each.name]), each.metadata["about"], each.default)
        for each in fields(cls)
        if "about" in each.metadata
    )


def _without_none(hint: Any) -> Any:
    return next(kind for kind in get_args(hint) if kind is not NoneType) if NoneType in get_args(hint) else hint


def plain(given: Any) -> Any:
    """Write a result as JSON knows it: brief fields, and properties in its ``SHOWN``; what is not finite is null."""
    if is_dataclass(given):
        shown = {name: getattr(given, name) for name in getattr(given, "SHOWN", ())}
        fields_ = {
            each.name: getattr(given, each.name)
            for each in described_fields(type(given))
            if each.about is None or each.about.brief
        }
        return {name: plain(each) for name, each in {**shown, **fields_}.items()}
    if isinstance(given, Mapping):
        return {name: plain(each) for name, each in given.items()}
    if isinstance(given, tuple | list | np.ndarray):
        return [plain(each) for each in given]
    given = given.item() if hasattr(given, "item") else given
    return None if isinstance(given, float) and not np.isfinite(given) else given


def column(rows: tuple[Any, ...], name: str) -> list[Any]:
    """List one field of the rows of a table."""
    return [getattr(row, name) for row in rows]


def datasets(cls: Any, prefix: str = "") -> Iterator[tuple[str, Described]]:
    """List the datasets of a result by path, for documentation."""
    for own in described_fields(cls):
        if own.about:
            yield f"{prefix}{own.name}", own
        else:
            inner = own.rows or (get_args(own.kind)[1] if get_origin(own.kind) is dict else own.kind)
            yield from datasets(inner, f"{prefix}{own.name}/")


@result
class Estimate:
    """A number with its 95 % interval."""

    value: float = about("as estimated", gaps=True)
    low: float = about("lower end of the 95 % interval", gaps=True)
    high: float = about("upper end of the 95 % interval", gaps=True)

    @property
    def half(self) -> float:
        """Half the width of the interval."""
        return 0.5 * (self.high - self.low)
