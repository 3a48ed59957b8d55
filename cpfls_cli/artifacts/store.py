"""Read and write artifacts: HDF5, atomic, self-describing, equal bytes for equal content."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.formats import format_of
from cpfls_cli.artifacts.spec import SCHEMA_VERSION, ArtifactSpec, DatasetSpec
from cpfls_cli.errors import InputError

CONFIG = "config"
INPUTS = "inputs"


@dataclass(frozen=True)
class InputFile:
    """A file that an artifact was made from.

    Attributes
    ----------
    name : str
        File name without its folder.
    sha256 : str
    format : str
        Artifact format, or ``csv``.
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
    config : str
        The resolved study as YAML.
    inputs : mapping of str to InputFile
        By role.
    """

    version: str
    seed: int
    config: str
    inputs: Mapping[str, InputFile] = field(default_factory=dict)


@dataclass(frozen=True)
class Artifact:
    """One artifact in memory.

    Attributes
    ----------
    spec : ArtifactSpec
    header : Header
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


def file_sha256(path: Path) -> str:
    """Hash a file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    str
        Hexadecimal SHA-256.
    """
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def check_output(path: Path, force: bool) -> None:
    """Refuse an output that cannot or must not be written, before anything is computed.

    Parameters
    ----------
    path : Path
    force : bool
        Allow an existing file to be replaced.

    Raises
    ------
    InputError
        If the file exists, its folder does not, or the folder cannot be written.
    """
    with atomic_path(path):
        if path.is_dir():
            raise InputError(f"{path}: is a folder; -o names a file")
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: is a device or a pipe; -o names a file")
        if path.exists() and not force:
            raise InputError(f"{path}: exists already; --force replaces it")


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Give a temporary name beside a file, and remove what is left of it afterwards.

    Parameters
    ----------
    path : Path
        The file to be written in the end; the caller moves the temporary file there with `os.replace`.

    Yields
    ------
    Path

    Raises
    ------
    InputError
        If the folder does not exist or cannot be written.
    """
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    except OSError as error:
        raise InputError(f"{path}: cannot write into the folder {path.parent}: {error.strerror}") from None
    temporary = Path(name)
    try:
        os.close(handle)
        # mkstemp makes private files; an artifact gets the permissions any new file would.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        yield temporary
    finally:
        temporary.unlink(missing_ok=True)


def write_artifact(path: Path, artifact: Artifact) -> None:
    """Write an artifact under a temporary name, then move it in place.

    Parameters
    ----------
    path : Path
    artifact : Artifact
        Datasets that its format does not know are refused.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    with atomic_path(path) as temporary:
        try:
            with h5py.File(temporary, "w") as file:
                _write_header(file, artifact)
                _write_data(file, artifact)
            os.replace(temporary, path)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error}") from None


def write_text(path: Path, text: str) -> None:
    """Write a text file under a temporary name, then move it in place.

    Parameters
    ----------
    path : Path
    text : str

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    with atomic_path(path) as temporary:
        try:
            temporary.write_text(text, encoding="utf-8")
            os.replace(temporary, path)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error}") from None


def read_artifact(path: Path, *wanted: ArtifactSpec) -> Artifact:
    """Read an artifact whole.

    Parameters
    ----------
    path : Path
    *wanted : ArtifactSpec
        Formats that the caller can use; any if none is named.

    Returns
    -------
    Artifact

    Raises
    ------
    InputError
        If the file is missing, truncated, foreign, of another stage or of a newer schema.
    """
    with _open(path) as file:
        try:
            spec = _identify(path, file)
            if wanted and spec not in wanted:
                asked = " or ".join(f"{w.format} (made by `cpfls {w.made_by}`)" for w in wanted)
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

    Parameters
    ----------
    path : Path

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
        raise InputError(f"{path}: cannot be read as an artifact: {reason}") from None
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
    spec = format_of(name)
    if spec is None:
        raise InputError(f"{path}: format = '{name}': this cpfls does not know it")
    return spec


def _write_data(file: h5py.File, artifact: Artifact) -> None:
    # In the order of the format, because the order of writing shows in the bytes of a file.
    specs = {spec.path: spec for spec in artifact.spec.datasets}
    unknown = artifact.data.keys() - specs.keys()
    if unknown:
        raise KeyError(f"{artifact.spec.format} has no dataset {min(unknown)}")
    for path, spec in specs.items():
        if path in artifact.data:
            _write_dataset(file, spec, artifact.data[path])


def _write_header(file: h5py.File, artifact: Artifact) -> None:
    header = artifact.header
    file.attrs["format"] = artifact.spec.format
    file.attrs["schema_version"] = SCHEMA_VERSION
    file.attrs["cpfls_version"] = header.version
    file.attrs["seed"] = header.seed
    file.attrs["config_sha256"] = _sha256(header.config)
    file.create_dataset(CONFIG, data=np.bytes_(header.config.encode()))
    for role, source in sorted(header.inputs.items()):
        group = file.create_group(f"{INPUTS}/{role}")
        for key in ("name", "sha256", "format"):
            group.attrs[key] = getattr(source, key)


def _read_header(file: h5py.File) -> Header:
    inputs = {
        role: InputFile(*(str(group.attrs[key]) for key in ("name", "sha256", "format")))
        for role, group in file.get(INPUTS, {}).items()
    }
    config = bytes(file[CONFIG][()]).decode()
    if _sha256(config) != file.attrs["config_sha256"]:
        raise ValueError(f"/{CONFIG} was changed after the file was written (config_sha256 differs)")
    return Header(str(file.attrs["cpfls_version"]), int(file.attrs["seed"]), config, inputs)


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


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
