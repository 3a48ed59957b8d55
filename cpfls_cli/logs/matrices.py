"""Reader of HDF5 and of MATLAB's .mat: arrays of numbers by their path, the columns of a matrix one by one."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.logs.formats import LogContents
from cpfls_cli.units import known_unit

_MOST_COLUMNS = 64
_TIME_UNITS = ("s", "ms", "us", "ns")


def contents(path: Path, wanted: Collection[str] | None = None) -> LogContents:
    """Read arrays of numbers by their path, ``group/name`` of a vector, ``group/name[column]`` of a matrix.

    A matrix has its samples along its longer axis, and stamps whose attribute states a unit of time are converted to
    s. What is wider than 64 columns, or holds no numbers, is left out.

    Raises
    ------
    InputError
        If the file cannot be read, is an artifact of this program, or holds no arrays of numbers.
    """
    try:
        is_hdf5 = h5py.is_hdf5(path)
        columns, units = _of_hdf5(path, wanted) if is_hdf5 else (dict(_named(_of_mat(path), wanted)), {})
    except InputError:
        raise
    except Exception as error:
        # Each version of .mat breaks in its own way: what the parsers raise is no fixed set.
        raise InputError(f"{path}: cannot be read as {'HDF5' if is_hdf5 else 'MATLAB'}: {error}") from None
    if not columns:
        raise InputError(f"{path}: holds no vectors or matrices of numbers")
    return LogContents({"": columns}, units)


def is_log(path: Path) -> bool:
    """Tell an HDF5 file of another program from an artifact of this one; what cannot be read is none."""
    try:
        with h5py.File(path, "r") as file:
            return not _artifact(file)
    except (OSError, RuntimeError):
        return False


def _artifact(file: h5py.File) -> str:
    name = file.attrs.get("format")
    return name if isinstance(name, str) and name.startswith("cpfls/") else ""


def _of_hdf5(path: Path, wanted: Collection[str] | None) -> tuple[dict[str, Array], dict[str, str]]:
    columns: dict[str, Array] = {}
    units: dict[str, str] = {}
    with h5py.File(path, "r") as file:
        if _artifact(file):
            raise InputError(f"{path}: is an artifact of this program ({_artifact(file)}), not a log")
        for name, dataset in _datasets(file):
            own = dict(_named([(name, dataset)], wanted))
            unit = dataset.attrs.get("units", dataset.attrs.get("unit", ""))
            unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit
            factor = known_unit(unit).factor if unit in _TIME_UNITS else 1.0
            columns |= {column: factor * values for column, values in own.items()}
            units |= {column: "s" if unit in _TIME_UNITS else unit for column in own if isinstance(unit, str) and unit}
    return columns, units


def _datasets(file: h5py.File) -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    # MATLAB keeps the insides of its cells and references below this name.
    file.visititems(
        lambda name, own: (
            found.append((name, own)) if isinstance(own, h5py.Dataset) and not name.startswith("#refs#") else None
        )
    )
    return found


def _of_mat(path: Path) -> Iterator[tuple[str, Any]]:
    def within(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(value, dict):
            for name, own in value.items():
                yield from within(f"{prefix}/{name}" if prefix else name, own)
        elif isinstance(value, np.ndarray):
            yield prefix, value

    variables = scipy.io.loadmat(str(path), simplify_cells=True)
    yield from within("", {name: value for name, value in variables.items() if not name.startswith("__")})


def _named(arrays: Iterable[tuple[str, Any]], wanted: Collection[str] | None) -> Iterator[tuple[str, Array]]:
    """Name the columns of arrays, and read those that are wanted."""
    for name, array in arrays:
        shape = tuple(size for size in array.shape if size != 1)
        count = min(shape) if len(shape) == 2 else 1
        # Integers, floats and booleans.
        if array.dtype.kind not in "iufb" or len(shape) not in (1, 2) or count > _MOST_COLUMNS:
            continue
        names = [name] if len(shape) == 1 else [f"{name}[{column}]" for column in range(count)]
        if wanted is not None and not set(names) & set(wanted):
            yield from ((each, np.empty(0)) for each in names)
            continue
        values = np.asarray(array[()], dtype=float).reshape(shape)
        columns = values if len(shape) == 2 and shape[0] < shape[1] else values.reshape(-1, count).T
        yield from zip(names, columns, strict=True)
