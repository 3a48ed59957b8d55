"""Results that describe themselves: each field of a result is a dataset of its file and a key of its JSON.

Numerics return results. This module knows no file: `store` writes and reads results, `page` shows them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    NamedTuple,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
from typing_extensions import Doc

from cpfls_cli.settings import Settings

T = TypeVar("T")
_UNIONS = (Union, UnionType)

EULER, BODY, WORLD = "Euler angles (intrinsic ZYX)", "body (FLU)", "world (z up)"
"""Frames of reference."""

AXES = {"axis": 3}
"""Axes of arrays whose name says their length."""


class About(NamedTuple):
    """What a value is.

    `text`: one line; `axes`: name of each axis of an array, two of one name in a result have one length; `unit`: ``1``
    is none; `gaps`: values may be missing, not finite; `least`: below which none is; `ascends`: each is above the one
    before, and there are two at least; `brief`: `--json` shows it too, what is not is in the file alone; `ragged`: each
    row of a table has a length of its own of it.
    """

    text: str
    axes: tuple[str, ...] = ()
    unit: str = "1"
    frame: str = "none"
    gaps: bool = False
    least: float = -np.inf
    ascends: bool = False
    brief: bool = True
    ragged: bool = False


def about(text: str, *axes: str, default: Any = MISSING, **more: Any) -> Any:
    """Describe a field; one with a default may be missing in a file.

    Fields of a named tuple say the same by ``Annotated[Array, About("text", ("axis",))]``.
    """
    return field(default=default, metadata={"about": About(text, axes, **more)})


def part(default: Any = MISSING, kind: Any = None, *, brief: bool = True) -> Any:
    """Make a field a result itself, a mapping from names to results, or a tuple of results: a table.

    Parameters
    ----------
    kind : type or None
        What is written, where the field may hold more than that.
    brief : bool
        Whether `--json` shows it too.
    """
    return field(default=default, metadata={"about": None, "kind": kind, "brief": brief})


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
    brief : bool
        Whether `--json` shows it too.
    """

    name: str
    kind: Any
    about: About | None
    default: Any
    optional: bool
    brief: bool = True

    @property
    def required(self) -> bool:
        """Whether every file holds it."""
        return self.default is MISSING

    @property
    def named(self) -> bool:
        """Whether it maps names to results."""
        return self.about is None and maps(self.kind)

    @property
    def rows(self) -> Any:
        """Class of the rows as which values by name, or arrays of several lengths, are written; None of all others."""
        if self.about is None:
            return None
        if maps(self.kind):
            return {str: _TextByName, int: _CountByName}.get(self.scalar, _NumberByName)
        return _Line if self.many and get_origin(get_args(self.kind)[0]) is np.ndarray else None

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


@cache
def maps(kind: Any) -> bool:
    """Tell whether a type maps names to something."""
    origin = get_origin(kind)
    return isinstance(origin, type) and issubclass(origin, Mapping)


@cache
def _scalar(kind: Any) -> type:
    origin, inner = get_origin(kind), get_args(kind)
    if maps(kind):
        return _scalar(inner[1])
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
    hints, annotated = get_type_hints(cls), get_type_hints(cls, include_extras=True)
    return tuple(
        Described(name, kind or _alone(hints[name]), known, default, NoneType in get_args(hints[name]), brief)
        for name, known, default, kind, brief in _written(cls, annotated)
    )


def _written(cls: Any, annotated: Mapping[str, Any]) -> Iterator[tuple[str, About | None, Any, Any, bool]]:
    """List what is described with default, kind and whether it is brief: of named tuples and of settings all."""
    for name in getattr(cls, "_fields", ()):
        own = (each for each in get_args(annotated[name]) if isinstance(each, About))
        known = next(own, None)
        yield name, known, cls._field_defaults.get(name, MISSING), None, known is None or known.brief
    for each in fields(cls) if is_dataclass(cls) else ():
        if "about" in each.metadata:
            known, brief = each.metadata["about"], each.metadata.get("brief", True)
            yield each.name, known, each.default, each.metadata.get("kind"), known.brief if known else brief
        elif issubclass(cls, Settings):
            yield each.name, _about_setting(each.name, annotated[each.name]), MISSING, None, True


def _about_setting(name: str, hint: Any) -> About | None:
    """Describe a setting by its own words; one that holds settings is a part."""
    kind, *more = get_args(hint)
    kind = _alone(kind)
    if any(isinstance(each, type) and issubclass(each, Settings) for each in (kind, *get_args(kind))):
        return None
    text = next((each.documentation for each in more if isinstance(each, Doc)), "")
    return About(text, (name,) if get_origin(kind) is tuple else (), "SI")


def _alone(hint: Any) -> Any:
    """Give what a hint allows but None: several values rather than one, of several kinds the first."""
    allowed = [kind for kind in get_args(hint) if kind is not NoneType] if get_origin(hint) in _UNIONS else [hint]
    return next((kind for kind in allowed if get_origin(kind) is tuple), allowed[0])


def plain(given: Any) -> Any:
    """Write a result as JSON knows it: brief fields, and properties in its ``SHOWN``; what is not finite is null."""
    described = (is_dataclass(given) or hasattr(given, "_fields")) and described_fields(type(given))
    if described or getattr(given, "SHOWN", ()):
        own = [each.name for each in described or () if each.brief]
        return {name: plain(getattr(given, name)) for name in (*getattr(given, "SHOWN", ()), *own)}
    if isinstance(given, Mapping):
        return {name: plain(each) for name, each in given.items()}
    if isinstance(given, np.ndarray) and given.dtype.kind in "biuf":
        return (given if np.isfinite(given).all() else np.where(np.isfinite(given), given, np.array(None))).tolist()
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


class _NumberByName(NamedTuple):
    name: Annotated[str, About("whose value it is")]
    value: Annotated[float, About("value", gaps=True)]


class _CountByName(NamedTuple):
    name: Annotated[str, About("of which it is the count")]
    value: Annotated[int, About("count")]


class _TextByName(NamedTuple):
    name: Annotated[str, About("what the text is about")]
    value: Annotated[str, About("text")]


class _Line(NamedTuple):
    values: Annotated[np.ndarray[Any, np.dtype[np.float64]], About("values", ("value",), ragged=True)]


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
