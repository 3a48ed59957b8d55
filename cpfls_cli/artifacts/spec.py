"""What an artifact is made of: its format, and the records whose fields are its datasets.

A format is a class: ``@record class TrajectoryRecord(Record)``, with one field for each dataset (`dataset`) or group of
datasets (`group`). A path is the name of its field where it does not say another; specification, writing, reading, the
check and the tables of docs/format.md follow from the fields.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cache
from types import NoneType
from typing import Any, ClassVar, NamedTuple, Self, TypeVar, dataclass_transform, get_args, get_type_hints

import numpy as np

from cpfls_cli.result import About

SCHEMA_VERSION = 3
"""Raised when a dataset is renamed, removed or changes its meaning; new optional datasets do not raise it."""

CONFIG = "config"
"""Path of the resolved study, in every artifact."""

INPUTS = "inputs"
"""Path of the group with one group for each input file, by role."""

EULER = "Euler angles (intrinsic ZYX)"
BODY = "body (FLU)"
WORLD = "world (z up)"
NO_FRAME = "none"

PART = 8192
"""Samples of a compressed artifact that are written at a time, each such part compressed on its own."""

_TEXT = "text"
_DATASET, _PATH, _APART = "dataset", "path", "apart"
FIXED = {"axis": 3}
"""Axes whose label says their length."""


@dataclass(frozen=True)
class DatasetSpec:
    """One dataset of an artifact.

    Attributes
    ----------
    path : str
        HDF5 path below the root.
    dimensions : tuple of str
        Labels of the axes; time or samples first. Digits fix the length, ``axis`` is 3.
    units : str
        SI units; ``1`` for a pure number, ``text`` for text.
    frame : str
        Frame of reference of its components.
    description : str
        What it holds.
    required : bool
        Whether every artifact of the format holds it.
    gaps : bool
        Whether values may be not finite, and mean "not known" there.
    into : str
        Label of the axis that its values are indices into; empty where they are none.
    least : float
        What no value is below.
    holds : str
        A text that is among its texts.
    """

    path: str
    dimensions: tuple[str, ...]
    units: str
    frame: str
    description: str
    required: bool = True
    gaps: bool = False
    into: str = ""
    least: float = -np.inf
    holds: str = ""

    @property
    def by_sample(self) -> bool:
        """Whether it holds a value for each sample."""
        return self.dimensions[:1] == ("time",)


@dataclass(frozen=True)
class Format:
    """One artifact format: a record says all but its datasets, which are its fields.

    A format of several kinds has one record for each, which adds sections of its own to what all of them hold.

    Attributes
    ----------
    name : str
        Value of the root attribute ``format``.
    description : str
        What it holds.
    made_by : str
        The commands that write it.
    inputs : tuple of str
        Roles of the files it was made from.
    compressed : bool
        Whether what has a value for each sample is compressed, and written some samples at a time.
    kind : str
        Value of the root attribute ``kind``; empty for a format of one kind, and for what all kinds hold.
    datasets : tuple of DatasetSpec
        In the order in which they are written, which shows in the bytes of a file.
    """

    name: str
    description: str
    made_by: str
    inputs: tuple[str, ...] = ()
    compressed: bool = False
    kind: str = ""
    datasets: tuple[DatasetSpec, ...] = ()

    def includes(self, other: Format) -> bool:
        """Tell whether an artifact of another specification is one of this."""
        return self.name == other.name and self.kind in ("", other.kind)

    @property
    def makers(self) -> str:
        """Name the commands that write it, as they are typed."""
        return " or ".join(f"`cpfls {command.strip()}`" for command in self.made_by.split(","))

    def dataset(self, path: str) -> DatasetSpec | None:
        """Look up a dataset by its path."""
        return next((spec for spec in self.datasets if spec.path == path), None)


# A group is a part of a result too, until it is a result itself: "about" describes its fields as `result.about` does.
def dataset(
    description: str,
    *dimensions: str,
    path: str = "",
    units: str = "1",
    frame: str = NO_FRAME,
    gaps: bool = False,
    into: str = "",
    least: float = -np.inf,
    holds: str = "",
    default: Any = MISSING,
) -> Any:
    """Make a field of a record a dataset; with ``default=None`` an artifact may lack it.

    The others are the attributes of `DatasetSpec`.

    Parameters
    ----------
    *dimensions : str
        Labels of the axes; none for a scalar.
    path : str
        Below the group of the record; empty for the name of the field.
    units : str
        SI units; text is told by the type of the field.
    """
    spec = DatasetSpec(path, dimensions, units, frame, description, default is MISSING, gaps, into, least, holds)
    own = About(description, dimensions, units, frame, gaps, least)
    return field(default=default, metadata={_DATASET: spec, _PATH: path or None, "about": own})


def group(path: str | None = None, *, default: Any = MISSING, apart: bool = False) -> Any:
    """Make a field of a record a group of datasets, itself a record; with ``default=None`` an artifact may lack all.

    Parameters
    ----------
    path : str or None
        Below the group of the outer record; empty where the inner paths are whole, None for the name of the field.
    apart : bool
        Whether its axes are as long as they like, though another group is a record of the same kind.
    """
    return field(default=default, metadata={_PATH: path, _APART: apart, "about": None})


_Class = TypeVar("_Class")


@dataclass_transform(
    eq_default=False, kw_only_default=True, frozen_default=True, field_specifiers=(dataset, group, field)
)
def record(cls: type[_Class]) -> type[_Class]:
    """Turn a class into an immutable record whose fields are datasets and groups."""
    return dataclass(frozen=True, kw_only=True, eq=False)(cls)


@dataclass(frozen=True)
class InputFile:
    """A file that an artifact was made from.

    Attributes
    ----------
    name : str
        File name without its folder.
    sha256 : str
        Hexadecimal.
    format : str
        Artifact format, or the suffix of another file.
    """

    name: str
    sha256: str
    format: str


@dataclass(frozen=True)
class Header:
    """Where an artifact comes from.

    Attributes
    ----------
    version : str
        Version of the program.
    seed : int
        Of the study.
    config : str
        The resolved study as YAML.
    inputs : mapping of str to InputFile
        By role.
    cautions : tuple of str
        What speaks against the models that it rests on, and numbers that are guesses.
    """

    version: str
    seed: int
    config: str
    inputs: Mapping[str, InputFile] = field(default_factory=dict)
    cautions: tuple[str, ...] = ()


@record
class Record:
    """One artifact in memory: where it comes from, and a field for each of its datasets or groups of them."""

    FORMAT: ClassVar[Format]
    header: Header | None = field(default=None)

    @classmethod
    def spec(cls) -> Format:
        """Give the format with its datasets."""
        return _format(cls)  # type: ignore[arg-type]  # classes are hashable

    @classmethod
    def of_data(cls, header: Header, data: Mapping[str, Any]) -> Self:
        """Build a record from its datasets by path."""
        return cls(header=header, **_values(cls, "", data))

    @classmethod
    def lacking(cls, present: Container[str]) -> list[str]:
        """List the datasets that an artifact with these paths lacks: of a group that is there, all but the optional."""
        return list(_lacking(cls, "", present))

    @property
    def data(self) -> dict[str, Any]:
        """Its datasets by path, in the order of the format."""
        return dict(_data(self, ""))

    @property
    def origin(self) -> Header:
        """Where it comes from; only a record that was written or read has it."""
        assert self.header is not None, "the record was neither written nor read"
        return self.header

    @classmethod
    def path(cls, name: str) -> str:
        """Give the path of the dataset that a field at the top of the record holds."""
        return next(entry.path for entry in _entries(cls) if entry.name == name)  # type: ignore[arg-type]

    def made_from(self, role: str) -> str | None:
        """Hash of an input by its role; None where it had none."""
        source = self.origin.inputs.get(role)
        return source.sha256 if source else None

    def input_name(self, role: str) -> str:
        """File name of an input by its role; empty where it had none."""
        source = self.origin.inputs.get(role)
        return source.name if source else ""

    def with_header(self, header: Header) -> Self:
        """Add where it comes from."""
        return replace(self, header=header)


def group_of(kind: type[_Class], result: object, /, **given: Any) -> _Class:
    """Arrange a result as a group: each field holds the attribute of its name, but for those that are given."""
    names = (entry.name for entry in _entries(kind))  # type: ignore[arg-type]  # classes are hashable
    return kind(**{name: getattr(result, name) for name in names if name not in given}, **given)


def columns_of(kind: type[_Class], rows: Iterable[object], /, **given: Any) -> _Class:
    """Arrange results as a group of columns, each given or the attributes of its name, one for each result."""
    listed = list(rows)
    columns = {
        entry.name: _read(entry.kind, [getattr(row, entry.name) for row in listed])
        for entry in _entries(kind)  # type: ignore[arg-type]  # classes are hashable
        if entry.name not in given
    }
    return kind(**columns, **given)


def rows_of(group: object) -> list[dict[str, Any]]:
    """List the rows of a group of columns, each by field."""
    columns = {
        entry.name: getattr(group, entry.name)
        for entry in _entries(type(group))  # type: ignore[arg-type]  # classes are hashable
        if getattr(group, entry.name) is not None
    }
    listed = [values.tolist() if isinstance(values, np.ndarray) else values for values in columns.values()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*listed, strict=True)]


def paired(names: Iterable[str] | None, values: np.ndarray | None) -> dict[str, Any]:
    """Pair names with values, both datasets of a group; nothing where an artifact lacks them."""
    return {} if names is None or values is None else dict(zip(names, values.tolist(), strict=True))


class _Entry(NamedTuple):
    """A field that is a dataset, or a group (which has no specification), with its type without None."""

    name: str
    path: str
    kind: Any
    optional: bool
    spec: DatasetSpec | None
    apart: bool


@cache
def _entries(cls: Any) -> tuple[_Entry, ...]:
    hints = get_type_hints(cls)
    return tuple(
        _Entry(
            own.name,
            own.name if own.metadata[_PATH] is None else own.metadata[_PATH],
            _without_none(hints[own.name]),
            own.default is not MISSING,
            own.metadata.get(_DATASET),
            own.metadata.get(_APART, False),
        )
        for own in fields(cls)
        if own.metadata
    )


def _without_none(hint: Any) -> Any:
    return next((part for part in get_args(hint) if part is not NoneType), hint) if NoneType in get_args(hint) else hint


def _joined(prefix: str, path: str) -> str:
    return f"{prefix}/{path}" if prefix and path else prefix or path


def _specs(cls: Any, prefix: str, optional: bool) -> Iterator[DatasetSpec]:
    for entry in _entries(cls):
        path = _joined(prefix, entry.path)
        if entry.spec is None:
            for spec in _specs(entry.kind, path, optional or entry.optional):
                yield _relabelled(spec, f"{path}_") if entry.apart else spec
        else:
            units = _TEXT if entry.kind in (str, tuple[str, ...]) else entry.spec.units
            yield replace(entry.spec, path=path, units=units, required=entry.spec.required and not optional)


def _relabelled(spec: DatasetSpec, before: str) -> DatasetSpec:
    """Give axes labels of their own, but for those whose length their label says."""
    labels = (label if label.isdigit() or label in FIXED else before + label for label in spec.dimensions)
    return replace(spec, dimensions=tuple(labels), into=before + spec.into if spec.into else "")


@cache
def _format(cls: Any) -> Format:
    own: Format = cls.FORMAT
    return replace(own, datasets=tuple(_specs(cls, "", False)))


def _data(owner: Any, prefix: str) -> Iterator[tuple[str, Any]]:
    for entry in _entries(type(owner)):  # type: ignore[arg-type]  # classes are hashable
        value = getattr(owner, entry.name)
        if value is None:
            continue
        path = _joined(prefix, entry.path)
        if entry.spec is None:
            yield from _data(value, path)
        else:
            yield path, _stored(value)


def _stored(value: Any) -> Any:
    """Text as an array of text, also where there is none; truth as 0 and 1."""
    array = np.asarray(value)
    if isinstance(value, tuple | list) and not len(value):
        return array.astype("U1")
    return array.astype(np.uint8) if array.dtype == bool else array


def _is_there(entry: _Entry, inner: str, present: Container[str]) -> bool:
    """Tell whether a group is: an optional one is there where any of its datasets is."""
    return not entry.optional or any(spec.path in present for spec in _specs(entry.kind, inner, True))


def _lacking(cls: Any, prefix: str, present: Container[str]) -> Iterator[str]:
    for entry in _entries(cls):
        path = _joined(prefix, entry.path)
        if entry.spec is None:
            if _is_there(entry, path, present):
                yield from _lacking(entry.kind, path, present)
        elif not entry.optional and path not in present:
            yield path


def _values(cls: Any, prefix: str, data: Mapping[str, Any]) -> dict[str, Any]:
    values = {}
    for entry in _entries(cls):
        path = _joined(prefix, entry.path)
        if entry.spec is None:
            if _is_there(entry, path, data):
                values[entry.name] = entry.kind(**_values(entry.kind, path, data))
        elif path in data:
            values[entry.name] = _read(entry.kind, data[path])
        elif not entry.optional:
            raise LookupError(path)
    return values


def _read(kind: Any, value: Any) -> Any:
    """Give a stored value the type of its field; a field of type Any keeps what is stored, bit by bit."""
    if kind is Any:
        return value
    if kind in (str, int, float, bool):
        return kind(value.item() if hasattr(value, "item") else value)
    if kind == tuple[str, ...]:
        return tuple(str(text) for text in value)
    return np.asarray(value, dtype=get_args(get_args(kind)[1])[0])
