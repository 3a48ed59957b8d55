"""Read and write artifacts, whole or some rows: HDF5, atomic, self-describing, equal bytes for equal content.

What is not a good artifact is refused with one message.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import h5py
import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.check import (
    Origin,
    Stored,
    check_artifact,
    check_structure,
    check_values,
    one_line,
    opened,
    opened_file,
    origin_of,
    refuse,
    require_all,
    stored_of,
)
from cpfls_cli.artifacts.formats import record_of_format, stage_module
from cpfls_cli.artifacts.output import EnduringFile, sealed_output
from cpfls_cli.artifacts.patience import patient
from cpfls_cli.artifacts.spec import (
    CONFIG,
    INPUTS,
    PART,
    SCHEMA_VERSION,
    DatasetSpec,
    Format,
    Header,
    Record,
)
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.files import FileState, read_content, state_of, text_sha256

R = TypeVar("R", bound=Record)
T = TypeVar("T")

_SHORT = 8
"""Words of text that stand in an outline."""
_TEXT, _SCALAR = h5py.h5t.py_create(h5py.string_dtype(), logical=True), h5py.h5s.create(h5py.h5s.SCALAR)
"""Type and shape of a text that describes a dataset."""
_PLAIN = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
"""Neither the time of writing nor an order of attributes is kept."""
_PLAIN.set_obj_track_times(False)
_PLAIN.set_attr_creation_order(0)
_PLAIN_KINDS = "Siuf"
"""Kinds of numbers and text that artifacts hold."""
_KEPT_BYTES = 1_000_000
"""Size up to which an artifact that was read is kept."""


@dataclass(frozen=True)
class Artifact:
    """Any artifact as its datasets by path, for what treats all formats alike.

    Attributes
    ----------
    spec : Format
        Its format.
    header : Header
        Where it comes from.
    data : mapping of str to array
        By dataset path; text as arrays of str.
    """

    spec: Format
    header: Header
    data: Mapping[str, Any]

    def array(self, path: str) -> Array:
        """Get a dataset as an array of floats."""
        return np.asarray(self.data[path], dtype=float)

    def number(self, path: str) -> float:
        """Get a scalar dataset as a float."""
        return float(self.data[path])

    def text(self, path: str) -> str:
        """Get a scalar text dataset."""
        return str(self.data[path])

    def texts(self, path: str) -> list[str]:
        """Get a text dataset as a list."""
        return [str(item) for item in self.data[path]]


def read_record(path: Path, wanted: type[R], *needed: str) -> R:
    """Read an artifact of one format that keeps to it, with the fields that this command cannot do without."""
    artifact = read_artifact(path, wanted.spec())
    names = [wanted.path(name) for name in needed]
    missing = [name for name in names if name not in artifact.data]
    if missing:
        raise InputError(f"{path}: lacks {', '.join(missing)}; this stage needs {', '.join(names)}")
    if any(np.size(artifact.data[name]) == 0 for name in names):
        raise InputError(f"{path}: holds no samples")
    kind = record_of_format(artifact.spec.name, artifact.spec.kind)
    # Of a format of several kinds the record of the kind, which is one of what was asked for.
    return _record(path, artifact, kind if kind is not None and issubclass(kind, wanted) else wanted)


def read_any(path: Path) -> Record:
    """Read an artifact of any format."""
    artifact = read_artifact(path)
    wanted = record_of_format(artifact.spec.name, artifact.spec.kind)
    assert wanted is not None, "its format is known"
    return _record(path, artifact, wanted)


def _record(path: Path, artifact: Artifact, wanted: type[R]) -> R:
    try:
        return wanted.of_data(artifact.header, artifact.data)
    except LookupError as error:
        raise InputError(f"{path}: the {artifact.spec.name} lacks {error.args[0]}; make it again") from None
    except (ValueError, TypeError, ArithmeticError) as error:
        raise InputError(f"{path}: damaged: {one_line(error)}") from None


def write_record(path: Path, record: Record) -> None:
    """Write an artifact under a temporary name, then move it in place."""
    write_artifact(path, artifact_of(record))


def artifact_of(record: Record) -> Artifact:
    """Give the datasets of a record that was written or read, by path."""
    return Artifact(record.spec(), record.origin, record.data)


def read_artifact(path: Path, *wanted: Format) -> Artifact:
    """Read an artifact whole; a small one that stayed as it was is read once only."""
    known = _known(path, _small)
    if known is None or (wanted and not any(each.includes(known.spec) for each in wanted)):
        return _read_whole(path, *wanted)
    data = {name: own.copy() if isinstance(own, np.ndarray) else own for name, own in known.data.items()}
    return Artifact(known.spec, known.header, data)


def _read_whole(path: Path, *wanted: Format) -> Artifact:
    with opened(path, *wanted) as stored, patient(path):
        # What is large is not read before its structure is known to be good.
        if _size_of(stored) > _KEPT_BYTES:
            require_all(path, stored)
            refuse(path, check_structure(stored))
        return _all_of(path, stored)


def _all_of(path: Path, stored: Stored) -> Artifact:
    require_all(path, stored)
    artifact = Artifact(stored.spec, stored.header, {name: _read(own) for name, own in stored.data.items()})
    refuse(path, check_structure(artifact) or check_values(artifact))
    return artifact


def _size_of(stored: Stored) -> int:
    """Count the bytes of all datasets as they are in memory: compressed, a small file may hold much."""
    parts = (own.id for own in stored.data.values())
    return sum(part.get_space().get_simple_extent_npoints() * part.get_type().get_size() for part in parts)


def _known(path: Path, look: Callable[[FileState], T | None]) -> T | None:
    """Give what was found in a file while it stays as it is; None where it is no good: who reads it then says why."""
    try:
        return look(state_of(path))
    except (OSError, ValueError, InputError):
        return None


@lru_cache(maxsize=16)
def _small(state: FileState) -> Artifact | None:
    if state.size > _KEPT_BYTES:
        return None
    with opened(state.path) as stored, patient(state.path):
        return _all_of(state.path, stored) if _size_of(stored) <= _KEPT_BYTES else None


class _Origin(NamedTuple):
    """What an artifact is, where it comes from, and the shapes of its datasets."""

    spec: Format
    header: Header
    shapes: Mapping[str, tuple[int, ...]]


@lru_cache(maxsize=64)
def _origin_of(state: FileState) -> _Origin:
    # Who asks what a small one is mostly reads it next.
    known = _known(state.path, _small)
    if known is not None:
        return _Origin(known.spec, known.header, {name: np.shape(own) for name, own in known.data.items()})
    with opened(state.path) as stored:
        return _Origin(stored.spec, stored.header, {name: own.shape for name, own in stored.data.items()})


class _Result(NamedTuple):
    """What the result of a stage is, and where it comes from."""

    format: str
    header: Origin


@lru_cache(maxsize=64)
def _result_of(state: FileState) -> _Result | None:
    with opened_file(state.path) as file:
        return _Result(str(file.attrs["format"]), origin_of(file)) if stage_module(file.attrs) else None


@dataclass(frozen=True)
class Outline:
    """What an artifact holds, without what is large.

    Attributes
    ----------
    shapes : mapping of str to tuple of int
        Of all datasets, by path.
    values : mapping of str to object
        Single values, and a few words of text.
    """

    spec: Format
    header: Header
    shapes: Mapping[str, tuple[int, ...]]
    values: Mapping[str, Any]

    @classmethod
    def of(cls, artifact: Artifact) -> Outline:
        """Take the outline of what is read already."""
        arrays = {name: np.asarray(value) for name, value in artifact.data.items()}
        small = {name: own for name, own in arrays.items() if own.ndim == 0 or _is_short_text(own)}
        return cls(artifact.spec, artifact.header, {name: own.shape for name, own in arrays.items()}, small)


def read_outline(path: Path) -> Outline:
    """Read what an artifact holds, in little memory however large it is."""
    with opened(path) as stored, patient(path):
        require_all(path, stored)
        refuse(path, check_artifact(stored))
        small = (name for name, own in stored.data.items() if own.ndim == 0 or _is_short_text(own))
        values = {name: _read(stored.data[name]) for name in small}
        return Outline(stored.spec, stored.header, {name: own.shape for name, own in stored.data.items()}, values)


def _is_short_text(dataset: h5py.Dataset | Array) -> bool:
    return bool(dataset.dtype.kind in "SU" and dataset.size <= _SHORT)


def findings_of(path: Path) -> tuple[Format, list[str]]:
    """List what in an artifact breaks its format, in little memory however large it is."""
    with opened(path) as stored, patient(path):
        require_all(path, stored)
        return stored.spec, check_artifact(stored)


def format_name(path: Path) -> str | None:
    """Tell the format of a file without reading it whole; None where it is no artifact."""
    known, result = _known(path, _origin_of), _known(path, _result_of)
    return known.spec.name if known else result.format if result else None


def holds(path: Path, wanted: type[Record]) -> bool:
    """Tell whether a file is an artifact of one format, and of its kind, without reading it whole."""
    known = _known(path, _origin_of)
    return known is not None and wanted.spec().includes(known.spec)


def read_header(path: Path) -> Header | Origin:
    """Read where an artifact comes from, and none of its data."""
    known = _known(path, _origin_of) or _known(path, _result_of)
    if known is not None:
        return known.header
    with opened(path) as stored:
        return stored.header


def _read(dataset: h5py.Dataset) -> Any:
    kind = dataset.dtype
    if kind.kind not in _PLAIN_KINDS:
        return dataset[()]
    # As `dataset[()]`, which takes three times as long for what is small.
    value = np.empty(dataset.shape, kind)
    if value.size:
        dataset.id.read(h5py.h5s.ALL, h5py.h5s.ALL, value)
    return np.char.decode(value, "utf-8") if kind.kind == "S" else value[()]


def write_artifact(path: Path, artifact: Artifact) -> None:
    """Write an artifact under a temporary name, then move it in place."""
    _refuse_result(path, check_artifact(artifact))
    with sealed_output(path) as output:
        _write(output, _parts(artifact), len(artifact.data["time"]) if artifact.spec.compressed else 0)


def write_parts(path: Path, parts: Iterable[Record], samples: int) -> None:
    """Write a record of a compressed format, `PART` samples in memory at a time; the bytes are those of the whole."""
    with sealed_output(path) as output:
        _write(output, map(artifact_of, parts), samples)
        with h5py.File(output, "r") as file:
            _refuse_result(path, check_artifact(stored_of(path, file)))


def _refuse_result(path: Path, findings: Sequence[str]) -> None:
    if findings:
        raise ComputationError("\n".join(f"{path}: not written: {finding}" for finding in findings))


def _parts(artifact: Artifact) -> Iterator[Artifact]:
    if not artifact.spec.compressed:
        yield artifact
        return
    single = {spec.path for spec in artifact.spec.datasets if not spec.by_sample}
    for start in range(0, len(artifact.data["time"]), PART):
        part = {name: own if name in single else own[start : start + PART] for name, own in artifact.data.items()}
        yield Artifact(artifact.spec, artifact.header, part)


def _write(output: EnduringFile, parts: Iterable[Artifact], samples: int) -> None:
    with h5py.File(output, "w") as file:
        done = 0
        for part in parts:
            if not done:
                _write_header(file, part)
                _write_data(file, part, samples)
            for name in (spec.path for spec in part.spec.datasets if spec.path in part.data and _in_parts(part, spec)):
                file[name][done : done + len(part.data[name])] = part.data[name]
            done += PART
            output.require_written()


def _in_parts(artifact: Artifact, spec: DatasetSpec) -> bool:
    return artifact.spec.compressed and spec.by_sample


def _write_header(file: h5py.File, artifact: Artifact) -> None:
    header = artifact.header
    file.attrs["format"] = artifact.spec.name
    if artifact.spec.kind:
        file.attrs["kind"] = artifact.spec.kind
    file.attrs["schema_version"] = SCHEMA_VERSION
    file.attrs["cpfls_version"] = header.version
    file.attrs["seed"] = header.seed
    file.attrs["config_sha256"] = text_sha256(header.config)
    if header.cautions:
        file.attrs["cautions"] = "\n".join(header.cautions)
    file.create_dataset(CONFIG, data=np.bytes_(header.config.encode()))
    for role, source in sorted(header.inputs.items()):
        group = file.create_group(f"{INPUTS}/{role}")
        for key in ("name", "sha256", "format"):
            group.attrs[key] = getattr(source, key)


def _write_data(file: h5py.File, artifact: Artifact, samples: int) -> None:
    """Write all but what comes in parts, and make room for that."""
    # In the order of the format, because the order of writing shows in the bytes of a file.
    specs = {spec.path: spec for spec in artifact.spec.datasets}
    unknown = artifact.data.keys() - specs.keys()
    if unknown:
        raise KeyError(f"{artifact.spec.name} has no dataset {min(unknown)}")
    groups: dict[str, h5py.Group] = {"": file}
    for path, spec in specs.items():
        if path in artifact.data:
            array = np.asarray(artifact.data[path])
            in_parts = _in_parts(artifact, spec)
            _describe(_empty(file, path, array, samples).id if in_parts else _whole(groups, path, array), spec)


def _whole(groups: dict[str, h5py.Group], path: str, array: np.ndarray) -> h5py.h5d.DatasetID:
    """Write a dataset as `create_dataset` does, which takes twice as long for what is small."""
    # Text of fixed length: variable-length text lives in a heap whose bytes are not reproducible.
    data = np.asarray(np.char.encode(array, "utf-8") if array.dtype.kind == "U" else array, order="C")
    parent, _, name = path.rpartition("/")
    if parent not in groups:
        groups[parent] = groups[""].require_group(parent)
    kind, space = h5py.h5t.py_create(data.dtype, logical=True), h5py.h5s.create_simple(data.shape, None)
    dataset = h5py.h5d.create(groups[parent].id, name.encode(), kind, space, dcpl=_PLAIN)
    dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, data)
    return dataset


def _empty(file: h5py.File, path: str, part: np.ndarray, samples: int) -> h5py.Dataset:
    shape, chunk = (samples, *part.shape[1:]), (min(samples, PART), *part.shape[1:])
    return file.create_dataset(path, shape, part.dtype, chunks=chunk, compression="gzip", shuffle=True)


def _describe(dataset: h5py.h5d.DatasetID, spec: DatasetSpec) -> None:
    # By the library below: to look first whether each is there took a third of the time to write a file.
    for name, text in ((b"units", spec.units), (b"frame", spec.frame), (b"description", spec.description)):
        h5py.h5a.create(dataset, name, _TEXT, _SCALAR).write(np.array(text, dtype=h5py.string_dtype()))
    for axis, label in enumerate(spec.dimensions):
        h5py.h5ds.set_label(dataset, axis, label.encode())


def file_sha256(path: Path) -> str:
    """Hash a file; one that was opened as an artifact before is not read again."""
    return read_content(path).sha256


def count_rows(path: Path, spec: Format, first: str) -> int | None:
    """Count the rows of a dataset; None where the file lacks it or is of no such format, as reading it whole tells."""
    known = _known(path, _origin_of)
    if known is None or not spec.includes(known.spec) or not known.shapes.get(first):
        return None
    return known.shapes[first][0]


def read_number(path: Path, name: str) -> float:
    """Read one number of an artifact without the rest; NaN where it lacks it."""
    with opened(path) as stored:
        return float(stored.data[name][()]) if name in stored.data else np.nan


def check_rows(path: Path, spec: Format, names: Sequence[str]) -> None:
    """Refuse datasets of these names that break the format of an artifact, some rows at a time."""
    with opened(path, spec) as stored, patient(path):
        missing = [name for name in names if name not in stored.data]
        if missing:
            raise InputError(f"{path}: lacks {', '.join(missing)}; this stage needs {', '.join(names)}")
        needed = Stored(spec, stored.header, {name: stored.data[name] for name in names})
        refuse(path, check_structure(needed) or check_values(needed))


def read_rows(path: Path, names: Sequence[str], start: int, stop: int, rows: int) -> Iterator[list[Array]]:
    """Read rows of datasets of equal length, up to the one before `stop`, so many at a time."""
    with opened(path) as stored:
        datasets = [stored.data[name] for name in names]
        for first in range(start, stop, rows):
            last = min(first + rows, stop)
            with patient(path):
                read = [np.asarray(dataset[first:last], dtype=float) for dataset in datasets]
            yield read
