"""Read artifacts, and refuse with one message what is not a good one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from cpfls_cli.artifacts.formats import format_of
from cpfls_cli.artifacts.hashing import text_sha256
from cpfls_cli.artifacts.records import Artifact, Header, InputFile
from cpfls_cli.artifacts.spec import CONFIG, INPUTS, SCHEMA_VERSION, ArtifactSpec
from cpfls_cli.errors import InputError


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
