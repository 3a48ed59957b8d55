"""Read and write artifacts, whole or some rows: HDF5, atomic, self-describing, equal bytes for equal content.

What is not a good artifact is refused with one message.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.check import check_artifact
from cpfls_cli.artifacts.formats import record_of_format
from cpfls_cli.artifacts.output import atomic_path
from cpfls_cli.artifacts.spec import (
    CONFIG,
    INPUTS,
    SCHEMA_VERSION,
    ArtifactSpec,
    DatasetSpec,
    Header,
    InputFile,
    Record,
)
from cpfls_cli.errors import InputError, NotAnArtifactError, OutputError

R = TypeVar("R", bound=Record)


@dataclass(frozen=True)
class Artifact:
    """Any artifact as its datasets by path, for what treats all formats alike.

    Attributes
    ----------
    spec : ArtifactSpec
        Its format.
    header : Header
        Where it comes from.
    data : mapping of str to array
        By dataset path; text as arrays of str.
    """

    spec: ArtifactSpec
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
    """Read an artifact of one format that keeps to it.

    Parameters
    ----------
    path : Path
        Of the file.
    wanted : type of Record
        Its format.
    *needed : str
        Fields at the top of the record that this command cannot do without.

    Raises
    ------
    InputError
        If the file is no good artifact of the format, or lacks a field or samples in it; the message names them.
    """
    artifact = read_artifact(path, wanted.spec())
    findings = check_artifact(artifact)
    if findings:
        raise InputError("\n".join(f"{path}: {finding}" for finding in findings))
    names = [wanted.path(name) for name in needed]
    missing = [name for name in names if name not in artifact.data]
    if missing:
        raise InputError(f"{path}: lacks {', '.join(missing)}; this stage needs {', '.join(names)}")
    if any(np.size(artifact.data[name]) == 0 for name in names):
        raise InputError(f"{path}: holds no samples")
    return _record(path, artifact, wanted)


def read_any(path: Path) -> Record:
    """Read an artifact of any format, without a check of its values.

    Raises
    ------
    InputError
        If the file is not a good artifact.
    """
    artifact = read_artifact(path)
    wanted = record_of_format(artifact.spec.format)
    assert wanted is not None, "its format is known"
    return _record(path, artifact, wanted)


def _record(path: Path, artifact: Artifact, wanted: type[R]) -> R:
    try:
        return wanted.of_data(artifact.header, artifact.data)
    except LookupError as error:
        raise InputError(f"{path}: the {artifact.spec.format} lacks {error.args[0]}; make it again") from None


def write_record(path: Path, record: Record) -> None:
    """Write an artifact under a temporary name, then move it in place.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    write_artifact(path, Artifact(record.spec(), record.origin, record.data))


def read_artifact(path: Path, *wanted: ArtifactSpec) -> Artifact:
    """Read an artifact whole.

    Parameters
    ----------
    *wanted : ArtifactSpec
        Formats that the caller can use; any if none is named.

    Raises
    ------
    InputError
        If the file is missing, truncated, foreign, of another stage or of a newer schema.
    """
    with _open(path) as file:
        try:
            spec = _identify(path, file)
            if wanted and spec not in wanted:
                asked = " or ".join(f"{w.format} (made by {w.makers})" for w in wanted)
                raise InputError(f"{path}: is a {spec.format}; this command needs a {asked}")
            missing = [d.path for d in spec.datasets if d.required and d.path not in file]
            if missing:
                raise InputError(f"{path}: the {spec.format} lacks {_some(missing)}; make it again")
            data = {d.path: _read(file[d.path]) for d in spec.datasets if d.path in file}
            return Artifact(spec, _read_header(file), data)
        except (OSError, LookupError, RuntimeError, ValueError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: damaged: {_one_line(error)}") from None


def format_name(path: Path) -> str | None:
    """Tell the format of a file without reading it whole.

    Returns
    -------
    str or None
        None where the file is not an artifact.
    """
    try:
        with h5py.File(path, "r") as file:
            return _text_attribute(file, "format")
    except (OSError, RuntimeError, ValueError):
        return None


def holds(path: Path, wanted: type[Record]) -> bool:
    """Tell whether a file is an artifact of one format, without reading it whole."""
    return path.is_file() and format_name(path) == wanted.FORMAT.name


def read_header(path: Path) -> Header:
    """Read where an artifact comes from, and none of its data.

    Raises
    ------
    InputError
        If the file is not a good artifact.
    """
    with _open(path) as file:
        try:
            _identify(path, file)
            return _read_header(file)
        except (OSError, LookupError, RuntimeError, ValueError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: damaged: {_one_line(error)}") from None


@contextmanager
def _open(path: Path) -> Iterator[h5py.File]:
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.is_dir():
        raise InputError(f"{path}: is a folder, not an artifact")
    if not path.is_file():
        raise InputError(f"{path}: is a device or a pipe, not a file")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: is empty")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        reason = "truncated" if "truncated" in str(error) else "not an HDF5 file, or damaged"
        raise NotAnArtifactError(path, f"{path}: cannot be read as an artifact: {reason}") from None
    with file:
        yield file


def _identify(path: Path, file: h5py.File) -> ArtifactSpec:
    name = _text_attribute(file, "format")
    if name is None or not name.startswith("cpfls/"):
        raise InputError(f"{path}: an HDF5 file, but not made by cpfls (no root attribute 'format')")
    version = file.attrs.get("schema_version")
    if not isinstance(version, int | np.integer):
        raise InputError(f"{path}: the root attribute 'schema_version' is missing or not a number")
    if version > SCHEMA_VERSION:
        raise InputError(
            f"{path}: schema_version = {version}: written by a newer cpfls; this one reads up to {SCHEMA_VERSION}"
        )
    known = record_of_format(name)
    if known is None:
        raise InputError(f"{path}: format = '{name}': this cpfls does not know it")
    return known.spec()


def _read_header(file: h5py.File) -> Header:
    inputs = {
        role: InputFile(*(str(group.attrs[key]) for key in ("name", "sha256", "format")))
        for role, group in file.get(INPUTS, {}).items()
    }
    config = bytes(file[CONFIG][()]).decode()
    if text_sha256(config) != file.attrs["config_sha256"]:
        raise ValueError(f"/{CONFIG} was changed after the file was written (config_sha256 differs)")
    return Header(str(file.attrs["cpfls_version"]), int(file.attrs["seed"]), config, inputs)


def _read(dataset: h5py.Dataset) -> Any:
    value = dataset[()]
    if dataset.dtype.kind == "S":
        return np.char.decode(np.asarray(value), "utf-8")
    return value


def _some(names: list[str], most: int = 5) -> str:
    rest = len(names) - most
    return ", ".join(names[:most]) + (f" and {rest} more" if rest > 0 else "")


def _one_line(error: Exception) -> str:
    return " ".join(str(error.args[0] if error.args else error).split())


def _text_attribute(file: h5py.File, name: str) -> str | None:
    value = file.attrs.get(name)
    return value if isinstance(value, str) else None


def write_artifact(path: Path, artifact: Artifact) -> None:
    """Write an artifact under a temporary name, then move it in place.

    Parameters
    ----------
    artifact : Artifact
        Datasets that its format does not know are refused.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    image = _image(artifact)
    with atomic_path(path) as temporary:
        try:
            with temporary.open("wb") as file:
                file.write(image)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from None


def _image(artifact: Artifact) -> memoryview:
    """Make the file in memory: HDF5 crashes the program where a disk fills up under it."""
    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        _write_header(file, artifact)
        _write_data(file, artifact)
    return image.getbuffer()


def _write_header(file: h5py.File, artifact: Artifact) -> None:
    header = artifact.header
    file.attrs["format"] = artifact.spec.format
    file.attrs["schema_version"] = SCHEMA_VERSION
    file.attrs["cpfls_version"] = header.version
    file.attrs["seed"] = header.seed
    file.attrs["config_sha256"] = text_sha256(header.config)
    file.create_dataset(CONFIG, data=np.bytes_(header.config.encode()))
    for role, source in sorted(header.inputs.items()):
        group = file.create_group(f"{INPUTS}/{role}")
        for key in ("name", "sha256", "format"):
            group.attrs[key] = getattr(source, key)


def _write_data(file: h5py.File, artifact: Artifact) -> None:
    # In the order of the format, because the order of writing shows in the bytes of a file.
    specs = {spec.path: spec for spec in artifact.spec.datasets}
    unknown = artifact.data.keys() - specs.keys()
    if unknown:
        raise KeyError(f"{artifact.spec.format} has no dataset {min(unknown)}")
    for path, spec in specs.items():
        if path in artifact.data:
            _write_dataset(file, spec, artifact.data[path])


def _write_dataset(file: h5py.File, spec: DatasetSpec, value: Any) -> None:
    array = np.asarray(value)
    # Text of fixed length: variable-length text lives in a heap whose bytes are not reproducible.
    stored = np.char.encode(array, "utf-8") if array.dtype.kind == "U" else array
    dataset = file.create_dataset(spec.path, data=stored)
    dataset.attrs["units"] = spec.units
    dataset.attrs["frame"] = spec.frame
    dataset.attrs["description"] = spec.description
    for axis, label in enumerate(spec.dimensions):
        dataset.dims[axis].label = label


def file_sha256(path: Path) -> str:
    """Hash a file.

    Returns
    -------
    str
        Hexadecimal SHA-256.
    """
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def text_sha256(text: str) -> str:
    """Hash a text.

    Returns
    -------
    str
        Hexadecimal SHA-256 of its UTF-8 bytes.
    """
    return hashlib.sha256(text.encode()).hexdigest()


def count_rows(path: Path, spec: ArtifactSpec, first: str) -> int | None:
    """Count the rows of a dataset.

    Parameters
    ----------
    first : str
        Path of the dataset.

    Returns
    -------
    int or None
        None where the file is no artifact of this format or lacks the dataset; reading it whole says why.
    """
    if format_name(path) != spec.format:
        return None
    try:
        with h5py.File(path, "r") as file:
            return len(file[first]) if first in file and file[first].ndim else None
    except (OSError, RuntimeError, ValueError, TypeError):
        return None


def check_rows(path: Path, spec: ArtifactSpec, names: Sequence[str], rows: int) -> None:
    """Refuse datasets of an artifact that break its format, chunk by chunk.

    Parameters
    ----------
    names : sequence of str
        Paths of datasets; the first ascends.
    rows : int
        Read at a time.

    Raises
    ------
    InputError
        If one is missing, has another length or shape, is not finite, or the first does not ascend.
    """
    with h5py.File(path, "r") as file:
        length = len(file[names[0]])
        for name in names:
            dataset, known = file.get(name), spec.dataset(name)
            assert known is not None
            if dataset is None:
                raise InputError(f"{path}: lacks {name}; this stage needs {', '.join(names)}")
            shape = (length, *(3 for _ in known.dimensions[1:]))
            if dataset.shape != shape:
                raise InputError(f"{path}: {name}: has shape {dataset.shape}, expected {shape}")
    last, start = -np.inf, 0
    for block in read_rows(path, names, 0, length, rows):
        for name, values in zip(names, block, strict=True):
            bad = np.flatnonzero(~np.isfinite(values).reshape(len(values), -1).all(axis=1))
            if bad.size:
                raise InputError(f"{path}: {name}: is not finite at index {start + int(bad[0])}")
        steps = np.diff(block[0], prepend=last)
        if np.any(steps <= 0):
            raise InputError(f"{path}: {names[0]}: does not ascend at index {start + int(np.argmax(steps <= 0))}")
        last, start = float(block[0][-1]), start + len(block[0])


def read_rows(path: Path, names: Sequence[str], start: int, stop: int, rows: int) -> Iterator[list[Array]]:
    """Read some rows of datasets, a few at a time.

    Parameters
    ----------
    names : sequence of str
        Paths of datasets of equal length.
    start, stop : int
        First row, and the one after the last.
    rows : int
        Read at a time.

    Yields
    ------
    list of array
        One for each dataset.

    Raises
    ------
    InputError
        If the file cannot be read any more.
    """
    try:
        with h5py.File(path, "r") as file:
            datasets = [file[name] for name in names]
            for first in range(start, stop, rows):
                last = min(first + rows, stop)
                yield [np.asarray(dataset[first:last], dtype=float) for dataset in datasets]
    except (OSError, KeyError, RuntimeError) as error:
        raise InputError(f"{path}: cannot be read any more: {' '.join(str(error).split())}") from None
