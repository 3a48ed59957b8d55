"""Reader of CSV: plain or gzip-compressed, comma, semicolon or tab, every field a number."""

from __future__ import annotations

import csv
import gzip
import io
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.logs.formats import LogColumns


def read(path: Path, settings: ImportSettings) -> LogColumns:
    """Read the columns of a log that a config maps."""
    return LogColumns(read_csv(path, set(settings.mapped_columns)))


def read_csv(path: Path, wanted: set[str]) -> dict[str, Array]:
    """Read columns of a CSV.

    Parameters
    ----------
    path : Path
        ``.csv`` or ``.csv.gz`` with one line of names.
    wanted : set of str
        Columns to read as numbers; others by name only, so that a message can suggest them.

    Returns
    -------
    dict of str to array, shape (rows,)
        Wanted columns that exist; the others map to empty arrays. Empty fields are NaN.

    Raises
    ------
    InputError
        If the file is empty, not text, has rows of unequal length or fields that are not numbers.
    """
    try:
        with _open(path) as stream:
            return _columns(path, stream, wanted)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not a CSV file: {error}") from None


@contextmanager
def _open(path: Path) -> Iterator[TextIO]:
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rb") as raw, io.TextIOWrapper(raw, encoding="utf-8-sig", newline="") as text:
        yield text


def _columns(path: Path, stream: TextIO, wanted: set[str]) -> dict[str, Array]:
    first = stream.readline()
    if not first.strip():
        raise InputError(f"{path}: is empty; a log starts with a line of column names")
    delimiter = max(",;\t", key=first.count)
    names = [name.strip() for name in next(csv.reader([first], delimiter=delimiter))]
    repeated = sorted({name for name in names if names.count(name) > 1 and name in wanted})
    if repeated:
        raise InputError(f"{path}: column '{repeated[0]}' stands twice")
    kept = [index for index, name in enumerate(names) if name in wanted]
    rows = []
    for number, row in enumerate(csv.reader(stream, delimiter=delimiter), start=2):
        if not row:
            continue
        if len(row) != len(names):
            raise InputError(f"{path}:{number}: {len(row)} fields, but {len(names)} column names")
        rows.append([_number(row[index], path, number, names[index]) for index in kept])
    if not rows:
        raise InputError(f"{path}: holds column names but no samples")
    values = np.array(rows, dtype=float).reshape(len(rows), len(kept))
    columns: dict[str, Array] = {name: np.empty(0) for name in names}
    return columns | {names[index]: values[:, position] for position, index in enumerate(kept)}


def row_lines(path: Path) -> list[int]:
    """List the line number of each row of values in a CSV; empty lines hold none.

    Parameters
    ----------
    path : Path
        As `read_csv` takes it.

    Returns
    -------
    list of int
        From 1; the line of names comes before the first row.
    """
    with _open(path) as stream:
        lines = [number for number, line in enumerate(stream, start=1) if line.strip()]
    return lines[1:]


def _number(field: str, path: Path, row: int, column: str) -> float:
    text = field.strip()
    if not text:
        return float("nan")
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{path}:{row}: column '{column}' = {text[:40]!r}: not a number") from None
