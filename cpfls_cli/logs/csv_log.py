"""Reader of CSV: plain or gzip-compressed, comma, semicolon or tab, every field a number."""

import csv
import gzip
import io
import zlib
from array import array
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TextIO

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.files import most_held
from cpfls_cli.logs.formats import MOST_LISTED, LogContents
from cpfls_cli.words import some

_LONGEST_LINE = 1 << 20
"""Characters of a line, which may hold thousands of columns; compressed, a longer one may fill the memory."""


def contents(path: Path, wanted: Collection[str] | None = None) -> LogContents:
    """Read columns of a log; without a wish, those whose first value is a number or absent."""
    if wanted is not None:
        return LogContents({"": read_csv(path, set(wanted))})
    with _rows(path) as (names, rows):
        first = next((row for row in rows if row), [])
    numeric = [name for name, text in zip(names, first, strict=False) if _is_number(text)]
    left_out = sorted(set(names) - set(numeric))
    warnings = (f"columns that hold text are left out: {some(left_out, MOST_LISTED)}",) if left_out else ()
    columns = read_csv(path, set(numeric))
    return LogContents({"": {name: columns[name] for name in numeric}}, warnings=warnings)


def read_csv(path: Path, wanted: set[str]) -> dict[str, Array]:
    """Read columns of a CSV, empty fields as NaN; those that are not wanted by name only, for a message to suggest."""
    with _rows(path) as (names, lines):
        repeated = sorted(name for name, count in Counter(names).items() if count > 1 and name in wanted)
        if repeated:
            raise InputError(f"{path}: column '{repeated[0]}' appears twice")
        kept = [index for index, name in enumerate(names) if name in wanted]
        # Lists of numbers would take ten times as much.
        numbers, count = array("d"), 0
        for number, row in enumerate(lines, start=2):
            if not row:
                continue
            if len(row) != len(names):
                raise InputError(f"{path}:{number}: {len(row)} fields, but {len(names)} column names")
            try:
                numbers.extend(_plain_numbers([row[index] for index in kept]))
            except ValueError:
                numbers.extend([_number(row[index], path, number, names[index]) for index in kept])
            count += 1
    if not count:
        raise InputError(f"{path}: holds column names but no samples")
    values = np.array(numbers).reshape(count, len(kept))
    columns: dict[str, Array] = {name: np.empty(0) for name in names}
    return columns | {names[index]: values[:, position] for position, index in enumerate(kept)}


@contextmanager
def _rows(path: Path) -> Iterator[tuple[list[str], Iterator[list[str]]]]:
    """Open a CSV: its column names, and its rows."""
    try:
        if path.suffix == ".gz":
            _refuse_inflated(path)
        with _open(path) as stream:
            first = stream.readline(_LONGEST_LINE)
            if len(first) == _LONGEST_LINE:
                raise InputError(f"{path}: not a CSV file: its first line, the column names, does not end")
            if not first.strip():
                raise InputError(f"{path}: is empty; a log starts with a line of column names")
            delimiter = max(",;\t", key=first.count)
            names = [name.strip() for name in next(csv.reader([first], delimiter=delimiter))]
            if len(names) > 1 and all(name and _is_number(name) for name in names):
                raise InputError(
                    f"{path}: has no line of column names: the first one holds numbers; write names above it, such as"
                    " t,gyro_x,gyro_y,gyro_z,..."
                )
            # Of a line without an end a part is a row, of another length than all others.
            yield names, csv.reader(iter(partial(stream.readline, _LONGEST_LINE), ""), delimiter=delimiter)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not a CSV file: {error}") from None


def _refuse_inflated(path: Path) -> None:
    """Refuse a compressed log of more text than its numbers may make up."""
    # A number and what parts it from the next take two letters at least, and eight bytes.
    most, held = most_held(path.stat().st_size) // 4, 0
    with gzip.open(path) as raw:
        while part := raw.read(_LONGEST_LINE):
            held += len(part)
            if held > most:
                raise InputError(f"{path}: holds more than {most / 1e6:.3g} MB of text: damaged, or not a log")


@contextmanager
def _open(path: Path) -> Iterator[TextIO]:
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rb") as raw, io.TextIOWrapper(raw, encoding="utf-8-sig", newline="") as text:
        yield text


def row_lines(path: Path) -> list[int]:
    """List the line number, from 1, of each row of values in a CSV; empty lines hold none."""
    with _open(path) as stream:
        lines = [number for number, line in enumerate(stream, start=1) if line.strip()]
    return lines[1:]


def _is_number(text: str) -> bool:
    try:
        _plain_numbers([text.strip() or "nan"])
    except ValueError:
        return False
    return True


def _number(field: str, path: Path, row: int, column: str) -> float:
    text = field.strip()
    if not text:
        return float("nan")
    try:
        return _plain_numbers([text])[0]
    except ValueError:
        raise InputError(f"{path}:{row}: column '{column}' = {text[:40]!r}: not a number") from None


def _plain_numbers(fields: list[str]) -> list[float]:
    # Python's own numbers may hold underscores and digits of any script; no log means such a number.
    together = "".join(fields)
    if "_" in together or not together.isascii():
        raise ValueError(together)
    return list(map(float, fields))
