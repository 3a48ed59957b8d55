"""Results in HDF5 files that describe themselves: written whole or not at all, checked when written and when read.

A field of a result is a dataset, a part is a group. A table is a group with one dataset for each field of its rows, as
long as the table; what some rows lack, or hold several of, lies in a group of its own with the ``row`` of each line.
Of a class with the axis ``STREAMED`` arrays along it are written and read some rows at a time, so that a long flight
needs little memory.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import nullcontext
from dataclasses import MISSING, replace
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.gate import (
    CONFIG,
    INPUTS,
    MAKERS,
    PART,
    SCHEMA_VERSION,
    DatasetSpec,
    dataset_of,
    held_format,
    identified,
    opened_file,
    stage_module,
)
from cpfls_cli.artifacts.gate import Origin as Origin
from cpfls_cli.artifacts.gate import format_name as format_name
from cpfls_cli.artifacts.gate import read_origin as read_origin
from cpfls_cli.artifacts.output import sealed_output
from cpfls_cli.artifacts.patience import patient
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.result import AXES, About, Described, described_fields, maps
from cpfls_cli.words import some

T = TypeVar("T")

_PACKED_BYTES = 1 << 17
"""Size from which a dataset is compressed: numbers that were measured become an eighth smaller, smooth ones by half."""
_LARGEST = 1e150
"""Nothing that is measured or computed comes near; the square of a larger number is none."""
_BLOCK = 1 << 18
"""Rows that are checked at a time."""
IN_MEMORY = 500_000
"""Rows of a result that are held in memory, of a flight 52 MB of motion and torque."""
_ROW = About("row of the table that each line belongs to", ("line",), least=0)
_NUMPY: Mapping[type, Any] = {bool: np.bool_, int: np.int64, float: np.float64, complex: np.complex128, str: np.str_}
_SHORT: Mapping[type, Any] = {float: np.float32, int: np.uint16}
_HELD = {bool: "bui", int: "iub", float: "fiub", complex: "cfiub", str: "US"}
"""Kinds of arrays that hold values of a type."""

Lengths = MutableMapping[str, tuple[int, str]]
"""Length of each axis, and the dataset that it is known from."""

_TEXT = h5py.string_dtype()
_LINE = h5py.h5t.py_create(_TEXT, logical=True), h5py.h5s.create(h5py.h5s.SCALAR)
"""Type and space of an attribute that is text."""
_UNDATED = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
_UNDATED.set_obj_track_times(False)


def write(path: Path, given: Any, origin: Origin) -> None:
    """Write a result, whose class names its ``FORMAT``; one that breaks its own description is refused."""
    axis = getattr(type(given), "STREAMED", "")
    rows = len(getattr(given, axis)) if axis else 0
    if rows:
        # Of the parts none is seen whole.
        require_sound(path, given)
    # In parts too, so that equal content is equal bytes however it came.
    parts = ({name: getattr(given, name)[at : at + PART] for name in _streamed(given)} for at in range(0, rows, PART))
    write_parts(path, (replace(given, **part) for part in parts) if rows else [given], rows, origin)


def write_parts(path: Path, parts: Iterable[Any], rows: int, origin: Origin) -> None:
    """Write a result of which no more than a part is in memory: what is not along ``STREAMED`` is that of the last.

    Parameters
    ----------
    rows : int
        Along ``STREAMED``, in all parts together.
    """
    with sealed_output(path) as output, h5py.File(output, "w") as file:
        done = 0
        for part in parts:
            if not done:
                require_sound(path, part)
                _write_origin(file, type(part), origin)
                _write(file, part, rows, streamed=True)
            for name in _streamed(part):
                values = getattr(part, name)
                file[name][done : done + len(values)] = values
            done += len(getattr(part, type(part).STREAMED)) if rows else 1
            output.require_written()
        if rows:
            # What lies along the axis is checked in the file, all of it; the rest may have come with the last part.
            streamed = _streamed(part)
            wrong = list(_wrong_rows(file, None, type(part), streamed))
            wrong = wrong or [each for each in findings(part) if each.partition(":")[0] not in streamed]
            if wrong:
                raise ComputationError("\n".join(f"{path}: not written: {each}" for each in wrong))
        _write(file, part, rows, streamed=False)
        output.require_written()


def _streamed(given: Any) -> list[str]:
    """Name what a result holds along the axis that is written in parts."""
    axis = getattr(type(given), "STREAMED", None)
    along = [own for own in described_fields(type(given)) if own.about and own.about.axes[:1] == (axis,)]
    return [own.name for own in along if getattr(given, own.name) is not None]


def _write_origin(file: h5py.File, kind: Any, origin: Origin) -> None:
    file.attrs["format"] = kind.FORMAT
    file.attrs["stage"] = origin.stage
    file.attrs["schema_version"] = SCHEMA_VERSION
    file.attrs["cpfls_version"] = origin.version
    file.attrs["cautions"] = "\n".join(origin.cautions)
    if origin.seed is not None:
        file.attrs["seed"] = origin.seed
    if origin.config:
        file[CONFIG] = np.bytes_(origin.config.encode())
    for role, source in sorted(origin.inputs.items()):
        file.create_group(f"{INPUTS}/{role}").attrs.update(vars(source))


def require_sound(path: Path, given: Any) -> None:
    """Refuse a result that breaks its own description; the path is that of the file it was to go into."""
    if wrong := findings(given):
        raise ComputationError("\n".join(f"{path}: not written: {each}" for each in wrong))


def _write(group: h5py.Group, given: Any, rows: int = 0, *, streamed: bool = False) -> None:
    """Write a part of a result: what is streamed, or all else."""
    along = _streamed(given) if rows else ()
    for own in described_fields(type(given)):
        value = getattr(given, own.name)
        if value is None or (own.name in along) != streamed:
            continue
        if own.rows or own.table:
            _write_table(group.create_group(own.name), own.rows or own.inner, _rows(own, value))
        elif own.about:
            _write_values(group, own.name, value, own, own.about, rows if streamed else 0)
        else:
            inner = group.create_group(own.name, track_order=own.named)
            for name, each in value.items() if own.named else [("", value)]:
                _write(inner.create_group(name) if name else inner, each)


def _write_table(group: h5py.Group, kind: type, rows: Sequence[Any]) -> None:
    group.attrs["rows"] = len(rows)
    axis = group.name.rpartition("/")[2]
    for own in described_fields(kind):
        values = [getattr(row, own.name) for row in rows]
        if _in_lines(own):
            lines = [_lines(own, value) for value in values]
            inner, values = group.create_group(own.name), [line for each in lines for line in each]
            row = np.repeat(np.arange(len(rows)), [len(each) for each in lines])
            _write_values(inner, "row", row, Described("row", int, _ROW, MISSING, False), _ROW)
            if own.about and not own.rows:
                about = own.about._replace(axes=("line", *own.about.axes[own.many or own.about.ragged :]))
                _write_values(inner, "values", values, own, about)
            else:
                _write_table(inner, own.rows or own.inner, values)
        elif own.about:
            _write_values(group, own.name, values, own, own.about._replace(axes=(axis, *own.about.axes)))
        else:
            _write_table(group.create_group(own.name), own.inner, values)


def _in_lines(own: Described) -> bool:
    """Tell whether rows of a table may lack it or hold several."""
    return own.optional or own.table or _several(own)


def _several(own: Described) -> bool:
    """Tell whether rows of a table may hold several values of it."""
    return bool(own.rows or own.many or (own.about and own.about.ragged))


def _lines(own: Described, value: Any) -> Sequence[Any]:
    return () if value is None else _rows(own, value) if own.table or _several(own) else (value,)


def _rows(own: Described, value: Any) -> Sequence[Any]:
    """Give values by name, or arrays of several lengths, as rows of a table; others as they are."""
    if not own.rows:
        return value  # type: ignore[no-any-return]
    return [own.rows(*each) for each in (value.items() if isinstance(value, Mapping) else zip(value))]


def _of_rows(own: Described, rows: Sequence[Any]) -> Any:
    return dict(rows) if maps(own.kind) else tuple(values for (values,) in rows)


def _write_values(group: h5py.Group, name: str, value: Any, own: Described, about: About, rows: int = 0) -> None:
    """Write a dataset; of one with rows that come in parts make it alone."""
    array = _as(own, value)
    if array.dtype.kind == "U":
        # Text of fixed length: that of variable length lies in a heap whose bytes are not reproducible.
        array = np.char.encode(array, "utf-8", "backslashreplace")
    array = array.astype(np.uint8) if array.dtype == bool else array
    if rows or (array.ndim and array.nbytes >= _PACKED_BYTES):
        shape, chunk = (rows or len(array), *array.shape[1:]), (min(rows, PART), *array.shape[1:]) if rows else True
        # The default level makes measured signals 1 to 2 % smaller, and a closed-loop flight takes 3 % longer.
        packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
        dataset = group.create_dataset(name, shape, array.dtype, chunks=chunk, **packed).id
    else:
        # By `create_dataset` each takes twice as long.
        space = h5py.h5s.create_simple(array.shape) if array.ndim else h5py.h5s.create(h5py.h5s.SCALAR)
        held = h5py.h5t.py_create(array.dtype, logical=True)
        dataset = h5py.h5d.create(group.id, name.encode(), held, space, _UNDATED)
    if not rows:
        dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, np.ascontiguousarray(array))
    unit = "text" if array.dtype.kind == "S" else about.unit
    for key, text in (("units", unit), ("frame", about.frame), ("description", about.text)):
        h5py.h5a.create(dataset, key.encode(), *_LINE).write(np.array(text, _TEXT))
    for axis, label in enumerate(about.axes[: array.ndim]):
        h5py.h5ds.set_label(dataset, axis, label.encode())


def read(path: Path, kind: type[T]) -> tuple[T, Origin]:
    """Read a result and where it comes from; one that breaks its description is refused, with all that does."""
    given, origin, wrong = examine(path, kind)
    if wrong:
        raise InputError("\n".join(f"{path}: {each}" for each in wrong))
    return given, origin


def is_long(path: Path, kind: Any) -> bool:
    """Tell whether a result has more rows than are held in memory."""
    axis = getattr(kind, "STREAMED", "")
    return bool(axis) and (count_rows(path, kind, axis) or 0) > IN_MEMORY


def findings_in(path: Path, kind: Any) -> list[str]:
    """Find everything in a file that its description does not allow; in a long one some rows at a time."""
    if not is_long(path, kind):
        return examine(path, kind)[2]
    names = held_rows(path, kind)
    with opened_file(path) as file:
        wrong = list(_wrong_rows(file, path, kind, names))
    return [*wrong, *(each for each in examine(path, kind, 2)[2] if each.partition(":")[0] not in names)]


def examine(path: Path, kind: type[T], rows: int | None = None) -> tuple[T, Origin, list[str]]:
    """Read a result, where it comes from, and everything in it that its description does not allow.

    Parameters
    ----------
    rows : int or None
        Along ``STREAMED``, so many at most.
    """
    with opened_file(path) as file, patient(path):
        wanted, held = kind.FORMAT, held_format(path, file)  # type: ignore[attr-defined]
        if held != wanted:
            made = MAKERS.get(wanted.removeprefix("cpfls/"), wanted.removeprefix("cpfls/"))
            raise InputError(f"{path}: is a {held}; this command needs a {wanted} (made by `cpfls {made}`)")
        origin, missing = identified(path, file)[1], list[str]()
        given = _read(kind, file, missing, rows)
    if missing:
        raise InputError(f"{path}: the {wanted} lacks {some(missing, 5)}; make it again")
    return given, origin, findings(given)


def flat(path: Path) -> dict[str, tuple[DatasetSpec, Any]]:
    """Read the datasets of a result by path, each with what its attributes say of it."""
    found: dict[str, tuple[DatasetSpec, Any]] = {}

    def take(name: str, held: h5py.Group | h5py.Dataset) -> None:
        if isinstance(held, h5py.Dataset) and name != CONFIG.strip("/"):
            labels = tuple(each.label for each in held.dims)
            unit, frame, text = (str(held.attrs.get(key, "")) for key in ("units", "frame", "description"))
            values = np.asarray(held[()])
            values = np.char.decode(values, "utf-8") if values.dtype.kind == "S" else values
            found[name] = DatasetSpec(name, labels, unit, frame, text), values

    with opened_file(path) as file, patient(path):
        file.visititems(take)
    return found


def count_rows(path: Path, kind: Any, name: str) -> int | None:
    """Count the rows of a dataset; None where a file lacks it or holds no result of this class."""
    try:
        with opened_file(path) as file:
            dataset = dataset_of(file, name) if _holds(file, kind) and name in file else None
            return None if dataset is None or not dataset.ndim else int(dataset.shape[0])
    except InputError:
        return None


def held_rows(path: Path, kind: Any) -> list[str]:
    """Name what a file holds along the axis that is written in parts."""
    with opened_file(path) as file:
        return [
            own.name
            for own in described_fields(kind)
            if own.about and own.about.axes[:1] == (kind.STREAMED,) and own.name in file
        ]


def read_rows(path: Path, names: Sequence[str], start: int, stop: int, rows: int) -> Iterator[list[Array]]:
    """Read rows of datasets of equal length, up to the one before `stop`, so many at a time."""
    with opened_file(path) as file:
        datasets = [_dataset(file, path, name) for name in names]
        for first in range(start, stop, rows):
            last = min(first + rows, stop)
            with patient(path):
                read = [np.asarray(dataset[first:last], dtype=float) for dataset in datasets]
            yield read


def check_rows(path: Path, kind: Any, names: Sequence[str]) -> None:
    """Refuse datasets along the axis that is written in parts which break their description, some rows at a time."""
    with opened_file(path) as file:
        with patient(path):
            for name in names:
                _dataset(file, path, name)
        wrong = list(_wrong_rows(file, path, kind, names))
    if wrong:
        raise InputError("\n".join(f"{path}: {each}" for each in wrong))


def _wrong_rows(file: h5py.File, path: Path | None, kind: Any, names: Sequence[str]) -> Iterator[str]:
    """Look at rows some at a time; a file that is read, not written, may be damaged, and is named."""
    fields = {own.name: own for own in described_fields(kind)}
    length = len(file[kind.STREAMED])
    for name in names:
        own, dataset = fields[name], file[name]
        assert own.about is not None, "a part has no rows"
        if len(dataset) != length:
            yield f"{name}: {len(dataset)} along '{kind.STREAMED}', but {length} by {kind.STREAMED}"
        for start in range(0, len(dataset), _BLOCK):
            # With the row before it, to see whether it ascends.
            with patient(path) if path else nullcontext():
                block = dataset[max(0, start - own.about.ascends) : start + _BLOCK]
            if found := [f"{each}, in rows from {start}" for each in _wrong(name, block, own, own.about, {})]:
                yield from found
                break


def _dataset(file: h5py.File, path: Path, name: str) -> h5py.Dataset:
    dataset = dataset_of(file, name) if name in file else None
    if dataset is None or not dataset.ndim:
        raise InputError(f"{path}: lacks {name}")
    return dataset


def _holds(file: h5py.File, kind: Any) -> bool:
    return bool(file.attrs.get("format") == kind.FORMAT and stage_module(file.attrs))


def stage_of(path: Path) -> str:
    """Name the module of the stage whose result a file is; empty where it is none, as who reads it then says."""
    try:
        with opened_file(path) as file:
            return stage_module(file.attrs)
    except InputError:
        return ""


def _read(kind: Any, group: h5py.Group, missing: list[str], rows: int | None = None) -> Any:
    given: dict[str, Any] = {}
    streamed = getattr(kind, "STREAMED", "")
    for own in described_fields(kind):
        # By the library's own look-up it takes three times as long.
        if own.name.encode() not in group.id:
            given |= _absent(own, group, missing)
        elif own.rows:
            given[own.name] = _of_rows(own, _read_table(own.rows, group[own.name], missing))
        elif own.about:
            few = slice(rows) if rows is not None and own.about.axes[:1] == (streamed,) else ()
            given[own.name] = _value(own, _values(group, own.name, own, few))
        elif own.table:
            given[own.name] = _read_table(own.inner, group[own.name], missing)
        elif own.named:
            given[own.name] = {name: _read(own.inner, each, missing) for name, each in group[own.name].items()}
        else:
            given[own.name] = _read(own.inner, group[own.name], missing)
    return kind(**given)


def _absent(own: Described, group: h5py.Group, missing: list[str]) -> dict[str, Any]:
    """Take note of what a file lacks and must not; the result is made without it, to find what else is missing."""
    if own.default is not MISSING:
        return {}
    if not own.optional:
        missing.append(f"{group.name}/{own.name}".replace("//", "/"))
    return {own.name: None}


def _read_table(kind: Any, group: h5py.Group, missing: list[str]) -> tuple[Any, ...]:
    rows = int(group.attrs["rows"])
    if not 0 <= rows <= group.file.id.get_filesize():
        raise ValueError(f"{group.name} cannot hold {rows} rows")
    columns: dict[str, Sequence[Any]] = {}
    for own in described_fields(kind):
        if own.name not in group:
            columns |= {name: [value] * rows for name, value in _absent(own, group, missing).items()}
        elif _in_lines(own):
            columns[own.name] = _read_lines(own, group[own.name], rows, missing)
        elif own.about:
            columns[own.name] = [_value(own, each) for each in _values(group, own.name, own)]
        else:
            columns[own.name] = _read_table(own.inner, group[own.name], missing)
    wrong = [name for name, values in columns.items() if len(values) != rows]
    if wrong:
        raise ValueError(f"{group.name} has {rows} rows, but {some(wrong, 3)} has not")
    return tuple(kind(**{name: values[row] for name, values in columns.items()}) for row in range(rows))


def _read_lines(own: Described, group: h5py.Group, rows: int, missing: list[str]) -> list[Any]:
    lines: Sequence[Any] = (
        [_value(own, each, single=_several(own)) for each in _values(group, "values", own)]
        if own.about and not own.rows
        else _read_table(own.rows or own.inner, group, missing)
    )
    by_row: list[list[Any]] = [[] for _ in range(rows)]
    for row, line in zip(group["row"][()].tolist(), lines, strict=True):
        by_row[row].append(line)
    if own.rows:
        return [_of_rows(own, each) for each in by_row]
    if own.about and own.about.ragged:
        return [np.array(each, _NUMPY[own.scalar]) for each in by_row]
    if own.table or own.many:
        return [tuple(each) for each in by_row]
    return [each[0] if each else None for each in by_row]


def _values(group: h5py.Group, name: str, own: Described, rows: Any = ()) -> np.ndarray[Any, Any]:
    dataset = dataset_of(group, name)
    if dataset is None or (held := dataset.id.dtype).kind not in _HELD[own.scalar]:
        raise ValueError(f"{group.name}/{name} holds no {own.scalar.__name__}".lstrip("/"))
    if rows:
        array = np.asarray(dataset[rows])
    else:
        array = np.empty(dataset.id.shape, held)
        dataset.id.read(h5py.h5s.ALL, h5py.h5s.ALL, array)
    return np.char.decode(array, "utf-8") if array.dtype.kind == "S" else _as(own, array)


def _as(own: Described, value: Any) -> np.ndarray[Any, Any]:
    """Give values in the type of their field; single precision is kept, and what needs 16 bits alone."""
    short = _SHORT.get(own.scalar)
    return np.asarray(value, short if short and getattr(value, "dtype", None) == short else _NUMPY[own.scalar])


def _value(own: Described, array: Any, *, single: bool = False) -> Any:
    if own.many and not single:
        return tuple(np.asarray(array).tolist())
    return np.asarray(array) if own.about and own.about.axes and not single else own.scalar(array)


def findings(given: Any) -> list[str]:
    """Find everything in a result that its description does not allow, a sentence each with the path."""
    return list(_findings(given, "", {}))


def _findings(given: Any, prefix: str, lengths: Lengths, *, row: bool = False) -> Iterator[str]:
    """Look at values first: the axes of a result have their lengths in its parts too."""
    for own in sorted(described_fields(type(given)), key=lambda each: each.about is None):
        path, value = f"{prefix}{own.name}", getattr(given, own.name)
        if value is None:
            yield from () if own.optional else (f"{path}: is missing",)
        elif own.about and not own.rows:
            # What rows of a table hold is as long in each of them, but for what they may hold several of.
            yield from _wrong(path, value, own, own.about, ChainMap({}, lengths) if row and _several(own) else lengths)
        elif own.rows or own.table:
            shared: Lengths = ChainMap({}, lengths)
            for index, each in enumerate(_rows(own, value)):
                yield from _findings(each, f"{path}/{index}/", shared, row=True)
        else:
            for name, each in value.items() if own.named else [("", value)]:
                if own.named and (not name or "/" in name or name == "."):
                    yield f"{path}: {name!r} cannot be the name of a part"
                inner = lengths if row else ChainMap({}, lengths)
                yield from _findings(each, f"{path}/{name}{'/' if name else ''}", inner, row=row)


def _wrong(path: str, value: Any, own: Described, about: About, lengths: Lengths) -> Iterator[str]:
    array = np.asarray(value, *([_NUMPY[own.scalar]] if np.size(value) == 0 else []))
    if array.dtype.kind not in _HELD[own.scalar]:
        yield f"{path}: holds {array.dtype}, expected {own.scalar.__name__}"
        return
    if array.ndim != len(about.axes):
        yield f"{path}: has {array.ndim} axes, expected {len(about.axes)} {about.axes}"
        return
    for label, length in zip(about.axes, array.shape, strict=True):
        fixed = int(label) if label.isdigit() else AXES.get(label)
        known, where = (fixed, "its description") if fixed else lengths.setdefault(label, (length, path))
        if length != known:
            yield f"{path}: {length} along '{label}', but {known} by {where}"
    if array.dtype.kind in "fc" and not about.gaps and not np.isfinite(array).all():
        yield f"{path}: {np.count_nonzero(~np.isfinite(array))} of {array.size} values are not finite"
    if array.dtype.kind == "f" and np.any(np.abs(array, dtype=float) > _LARGEST, where=np.isfinite(array)):
        yield f"{path}: holds values beyond {_LARGEST:g}"
    if array.dtype.kind in "iuf" and np.any(array < about.least):
        yield f"{path}: is below {about.least:g}"
    if about.ascends and len(array) < 2:
        yield f"{path}: holds {len(array)} samples; at least two are needed"
    elif about.ascends and np.any(falls := np.diff(array) <= 0):
        yield f"{path}: does not ascend at index {int(np.argmax(falls)) + 1}"
