"""Results that describe themselves: each field of a result is a dataset of its file and a key of its JSON.

Numerics return results. This module knows no file: `store` writes and reads results, `page` shows them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cache
from types import NoneType
from typing import Any, Literal, NamedTuple, TypeVar, dataclass_transform, get_args, get_origin, get_type_hints

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
    ascends : bool
        Whether each value is above the one before, and there are two at least.
    brief : bool
        Whether `--json` shows it too; what is not is in the file alone.
    """

    text: str
    axes: tuple[str, ...] = ()
    unit: str = "1"
    frame: str = "none"
    gaps: bool = False
    least: float = -np.inf
    ascends: bool = False
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
    """A field of a result.

    Attributes
    ----------
    kind : type
        Without the None of an optional one.
    about : About or None
        None for a part: a result, a mapping from names to results, or a table of them.
    default : object
        `MISSING` where every file must hold it.
    optional : bool
        Whether it may be None.
    """

    name: str
    kind: Any
    about: About | None
    default: Any
    optional: bool

    @property
    def required(self) -> bool:
        """Whether every file holds it."""
        return self.default is MISSING

    @property
    def named(self) -> bool:
        """Whether it maps names to results."""
        origin = get_origin(self.kind)
        return self.about is None and isinstance(origin, type) and issubclass(origin, Mapping)

    @property
    def table(self) -> bool:
        """Whether it is a tuple of results, one a row."""
        return self.about is None and get_origin(self.kind) is tuple

    @property
    def inner(self) -> Any:
        """Class of the results in a part."""
        return get_args(self.kind)[1] if self.named else get_args(self.kind)[0] if self.table else self.kind

    @property
    def scalar(self) -> type:
        """Type of a value, or of each of many: bool, int, float, complex or str."""
        return _scalar(self.kind)

    @property
    def many(self) -> bool:
        """Whether it is a tuple of values."""
        return self.about is not None and get_origin(self.kind) is tuple


def _scalar(kind: Any) -> type:
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Literal:
        return type(inner[0])
    if origin is tuple:
        return _scalar(inner[0])
    if kind is np.ndarray:
        # Arrays are of numbers unless they say more.
        return float
    if origin is np.ndarray:
        return _scalar(get_args(inner[1])[0])
    kinds = {
        bool: (bool, np.bool_),
        int: (int, np.integer),
        str: (str, np.str_),
        float: (float, np.floating),
        complex: (complex, np.complexfloating),
    }
    return next(own for own, alike in kinds.items() if issubclass(kind, alike))


def described_fields(cls: Any) -> tuple[Described, ...]:
    """List the fields of a result that are written, in their order."""
    return _described(cls)


@cache
def _described(cls: Any) -> tuple[Described, ...]:
    hints = get_type_hints(cls)
    written = [each for each in fields(cls) if "about" in each.metadata]
    kinds = [(each, hints[each.name]) for each in written]
    return tuple(
        Described(each.name, _without_none(kind), each.metadata["about"], each.default, NoneType in get_args(kind))
        for each, kind in kinds
    )


def _without_none(hint: Any) -> Any:
    return next(kind for kind in get_args(hint) if kind is not NoneType) if NoneType in get_args(hint) else hint


def plain(given: Any) -> Any:
    """Write a result as JSON knows it: brief fields, and properties in its ``SHOWN``; what is not finite is null."""
    if is_dataclass(given) and not isinstance(given, type):
        own = [each.name for each in described_fields(type(given)) if each.about is None or each.about.brief]
        return {name: plain(getattr(given, name)) for name in (*getattr(given, "SHOWN", ()), *own)}
    if isinstance(given, Mapping):
        return {name: plain(each) for name, each in given.items()}
    if isinstance(given, tuple | list | np.ndarray):
        return [plain(each) for each in given]
    given = given.item() if hasattr(given, "item") else given
    return None if isinstance(given, float) and not np.isfinite(given) else given


def column(rows: Iterable[Any], name: str) -> list[Any]:
    """List one field of the rows of a table."""
    return [getattr(row, name) for row in rows]


def datasets(cls: Any, prefix: str = "", row: str = "", required: bool = True) -> Iterator[tuple[str, Described]]:
    """List the values of a result by path, for documentation; those of tables have an axis of their rows first."""
    for own in described_fields(cls):
        needed = required and own.required
        if own.about:
            about = own.about._replace(axes=(row, *own.about.axes) if row else own.about.axes)
            yield f"{prefix}{own.name}", own._replace(about=about, default=MISSING if needed else None)
        else:
            inner = own.name if row or own.table else ""
            yield from datasets(own.inner, f"{prefix}{own.name}/{'*/' if own.named else ''}", inner, needed)


@result
class Estimate:
    """A number with its 95 % interval."""

    value: float = about("as estimated", gaps=True)
    low: float = about("lower end of the 95 % interval", gaps=True)
    high: float = about("upper end of the 95 % interval", gaps=True)

    @classmethod
    def around(cls, value: float, half: float) -> Estimate:
        """Make one whose value is in the middle."""
        return cls(value=float(value), low=float(value - half), high=float(value + half))

    @property
    def half(self) -> float:
        """Half the width of the interval."""
        return 0.5 * (self.high - self.low)
