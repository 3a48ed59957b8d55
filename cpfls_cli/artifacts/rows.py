"""Read some rows of an artifact too long to be read whole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import h5py
import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.spec import ArtifactSpec
from cpfls_cli.artifacts.store import format_name
from cpfls_cli.errors import InputError


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
