"""Write artifacts: HDF5, atomic, self-describing, equal bytes for equal content."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from cpfls_cli.artifacts.hashing import text_sha256
from cpfls_cli.artifacts.output import atomic_path
from cpfls_cli.artifacts.records import Artifact
from cpfls_cli.artifacts.spec import CONFIG, INPUTS, SCHEMA_VERSION, DatasetSpec
from cpfls_cli.errors import OutputError


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
