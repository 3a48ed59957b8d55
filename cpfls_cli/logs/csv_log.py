"""Reader of CSV: plain or gzip-compressed; comma, semicolon, tab or spaces; fields of numbers, lists or times."""

import csv
import gzip
import io
import re
import zlib
from array import array
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.files import most_held
from cpfls_cli.logs.blackbox import of_export
from cpfls_cli.logs.formats import MOST_LISTED, NAME_COLUMNS, LogContents
from cpfls_cli.words import some

# Characters of a line, which may hold thousands of columns; compressed, a longer one may fill the memory.
_LONGEST_LINE = 1 << 20
_LONGEST_ROW = 64  # Lines of the first row.
_LONGEST_LIST = 50  # Numbers of a list that becomes columns: of a vehicle nothing is longer, a scan is.
_REMARKS: Final = ("#", "%", "//")  # With which a remark before the column names begins.
# With which what Betaflight's log viewer exports begins; a spreadsheet drops the quotes and fills lines.
_EXPORT: Final = re.compile(r'"?Product"?[,;]"?Blackbox flight data recorder')
# A number as it is written in much of Europe, where semicolons separate columns.
_DECIMAL_COMMA: Final = re.compile(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*")


def contents(path: Path, wanted: Collection[str] | None = None) -> LogContents:
    """Read columns of a log; without a wish, those whose first value is a number, a time or absent."""
    with _opened(path) as table:
        names, first, stated = table.names, dict(zip(table.names, table.first, strict=False)), table.stated
        if len(said := [name for name, own in first.items() if name[:1].isalpha() and name == own.strip()]) > 1:
            way = f"leave the words out, and {NAME_COLUMNS}"
            raise InputError(f"{path}: each line says what its numbers are ({some(said, MOST_LISTED)}): {way}")
        # What is absent at first may be a word later on.
        for row in (own for _, own in table.rows if len(own) == len(first)):
            if all(map(str.strip, first.values())):
                break
            first = {name: own.strip() or later for (name, own), later in zip(first.items(), row, strict=True)}
    # Several columns without a name are of a spreadsheet that filled its lines.
    numeric = [name for name in names if name in first and _kind(first[name]) and (name or names.count("") < 2)]
    if stated:
        columns = read_csv(path, set(numeric))
        held = [name for name in numeric if np.isfinite(columns[name]).any()]
        ordered = sorted(held, key=lambda name: (name != "loopIteration", name != "time"))
        try:
            return of_export(stated, ordered, np.column_stack([columns[name] for name in ordered]))
        except (ValueError, OverflowError) as error:
            raise InputError(f"{path}: a broken export of a blackbox log: its header: {error}") from None
    units = {name: "s" for name in numeric if _kind(first[name]) == "time"}
    if wanted is not None:
        return LogContents({"": read_csv(path, set(wanted))}, units)
    left_out = sorted(set(names) - {*numeric, ""})
    if left_out and [name.lower() for name in numeric[1:]] == ["value"]:
        raise InputError(f"{path}: holds one value a row, named by {some(left_out, MOST_LISTED)}: give each a column")
    warnings = [f"columns that hold text are left out: {some(left_out, MOST_LISTED)}"] * bool(left_out)
    warnings += ["columns without a name are left out"] * (names.count("") > 1 and bool(first.get("", "").strip()))
    columns = read_csv(path, set(numeric))
    return LogContents({"": {name: columns[name] for name in numeric}}, units, warnings=tuple(warnings))


def read_csv(path: Path, wanted: set[str]) -> dict[str, Array]:
    """Read columns of a CSV, empty fields as NaN; those that are not wanted by name only, for a message to suggest."""
    with _opened(path) as table:
        names = table.names
        if repeated := sorted(table.repeated & wanted):
            raise InputError(f"{path}: column '{repeated[0]}' appears twice: map {repeated[0]}[0] or the next")
        kept = [index for index, name in enumerate(names) if name in wanted]
        # Lists of numbers would take ten times as much.
        numbers, count = array("d"), 0
        for number, row in table.rows:
            if not row:
                continue
            if len(row) != len(names):
                # A last line may have been cut, where more than one before it show how long they are.
                if len(row) < len(names) and count > 1 and not any(own for _, own in table.rows):
                    break
                way = "each row needs one field for each column name; a field that holds a separator needs quotes"
                way = "line 1 has to name each column, with nothing above it" if len(names) == 1 else way
                raise InputError(f"{path}:{number}: {len(row)} fields, but {len(names)} column names: {way}")
            try:
                numbers.extend(_plain_numbers([row[index] for index in kept]))
            except ValueError:
                if [own.strip() for own in row] == names:
                    raise InputError(
                        f"{path}:{number}: the column names again, of another log: keep one of them"
                    ) from None
                numbers.extend([_number(row[index], path, number, names[index]) for index in kept])
            count += 1
    if not count:
        raise InputError(f"{path}: holds column names but no samples")
    values = np.array(numbers).reshape(count, len(kept))
    return dict.fromkeys(names, np.empty(0)) | {names[index]: own for index, own in zip(kept, values.T, strict=True)}


_Rows = Iterator[tuple[int, list[str]]]


class _Table(NamedTuple):
    """A CSV that is open: column names, the first row that is not empty, all rows with the lines they begin on."""

    names: list[str]
    first: list[str]
    rows: _Rows
    stated: dict[str, str]  # Lines of the header of a log that a viewer exported, which stand before the names.
    repeated: frozenset[str] = frozenset()  # Names of several columns, which ``names`` numbers from 0.


@contextmanager
def _opened(path: Path) -> Iterator[_Table]:
    """Open a CSV, of commas, semicolons, tabs or spaces; remarks before the column names are skipped."""
    opener = gzip.open if path.suffix == ".gz" else open
    try:
        if path.suffix == ".gz":
            _refuse_inflated(path)
        with opener(path, "rb") as raw, io.TextIOWrapper(raw, encoding="utf-8-sig", newline="") as stream:
            # Of a line without an end a part is a row, of another length than all others.
            # Zeros are what a card holds where nothing was written.
            yield _table(path, (text.strip("\0") for text in iter(partial(stream.readline, _LONGEST_LINE), "")))
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not a CSV file: {error}") from None


def _table(path: Path, lines: Iterator[str]) -> _Table:
    remark, header, line = "", next(lines, ""), 1
    while header.startswith(_REMARKS):
        remark, header, line = header.lstrip("#%/ "), next(lines, ""), line + 1
    stated = {}
    if _EXPORT.match(header):
        while len(pair := _fields(header)) > 1 and not any(pair[2:]):
            stated[pair[0]] = pair[1]
            header, line = next(lines, ""), line + 1
    if len(header) == _LONGEST_LINE:
        raise InputError(f"{path}: not a CSV file: its first line, the column names, does not end")
    if not header.strip():
        raise InputError(f"{path}: is empty; a log starts with a line of column names")
    fields = [field.strip() for field in _fields(header)]
    numbers = [field for field in fields if _kind(field)]
    # What writes numbers has its column names in the last remark; a few columns of words have names there too. Words
    # and whole numbers may be the names themselves.
    some_words = len(fields) == len(_fields(remark)) < 2 * len(numbers) and not all(map(str.isdecimal, numbers))
    if remark and (len(numbers) == len(fields) or some_words):
        header, lines, line = remark, chain([header], lines), line - 1
    names = [name.strip() for name in _fields(header)]
    numbers = [name for name in names if name and _kind(name)]
    # Columns may be numbered, and a row of data may hold words.
    numbered = len(set(numbers)) == len(numbers) < len(names) and all(map(str.isdecimal, numbers))
    if 2 * len(numbers) > len(names) and not numbered:
        raise InputError(f"{path}: has no line of column names, line {line} holds {_ways(numbers, lines)}")
    begun, quotes = [], 0
    for text in lines:
        begun.append(text)
        quotes += text.count('"')
        # An array in quotes may go over several lines.
        if text.strip() and (quotes % 2 == 0 or len(begun) > _LONGEST_ROW):
            break
    # A field in quotes may hold another separator than what parts the names.
    for delimiter in (_delimiter("".join(begun).strip() or header), _delimiter(header)):
        first = next((own for _, own in _rows(iter(begun), delimiter) if own), [])
        if len(names) in (1, len(first)):
            break
    first, rows = _below_units(_rows(chain(begun, lines), delimiter, line), first)
    # A loop that writes a separator behind each field leaves an empty one, in either of both.
    while len(names) > len(first) > 0 and not names[-1]:
        names.pop()
    # What a viewer computes has no name in some of its exports.
    if len(first) > len(names) > 1 and (stated or not any(first[len(names) :])):
        rows = ((at, own[: len(names)] if stated or not any(own[len(names) :]) else own) for at, own in rows)
        first = first[: len(names)]
    if any(map(_DECIMAL_COMMA.fullmatch, first)):
        rows = ((at, list(map(_with_points, fields))) for at, fields in rows)
        first = list(map(_with_points, first))
    repeated = frozenset(name for name, count in Counter(names).items() if count > 1 and name)
    names = _numbered(names, repeated)
    sizes = [len(_listed(field)) for field in first] if len(names) == len(first) else []
    # What is called so already stays.
    taken = {*names}
    sizes = [0 if f"{name}[0]" in taken else size for name, size in zip(names, sizes, strict=False)]
    if any(sizes):
        rows = ((at, _spread(fields, sizes)) for at, fields in rows)
        parts = zip(names, sizes, strict=True)
        names = [own for name, size in parts for own in ([f"{name}[{at}]" for at in range(size)] or [name])]
        first = _spread(first, sizes)
    return _Table(names, first, rows, stated, repeated)


def _below_units(rows: _Rows, first: list[str]) -> tuple[list[str], _Rows]:
    """Leave out a row of words below the names, as of their units, where numbers come next; give the first of them."""

    def counts(fields: Sequence[str]) -> bool:
        return any(field.strip() and _kind(field) for field in fields)

    if counts(first):
        return first, rows
    ahead = list(islice((own for own in rows if own[1]), 2))
    ahead = ahead[len(ahead) > 1 and counts(ahead[1][1]) :]
    return ahead[0][1] if ahead else first, chain(ahead, rows)


def _ways(numbers: Sequence[str], lines: Iterator[str]) -> str:
    """Say how many numbers are where names should be, and what to write: of fewer lines, a line holds one signal."""
    turned = "write a line for each sample, not for each signal, and " * (1 + sum(map(bool, lines)) < len(numbers))
    return f"{len(numbers)} number{'s' * (len(numbers) > 1)}: {turned}{NAME_COLUMNS}"


def _numbered(names: Sequence[str], repeated: frozenset[str]) -> list[str]:
    """Give columns of one name numbers from 0 on, but for those that others have."""
    taken, last, numbered = {*names}, Counter[str](), []
    for name in names:
        own = name
        while name in repeated and own in taken:
            own, last[name] = f"{name}[{last[name]}]", last[name] + 1
        numbered.append(own)
    return numbered


def _with_points(field: str) -> str:
    return field if field.lstrip().startswith("[") else field.replace(",", ".")


def _listed(field: str) -> list[str]:
    """Part a field that holds a list or a matrix of numbers, as Python writes arrays into a table; others hold none."""
    parts = re.findall(r"[^][,\s]+", field) if field.lstrip().startswith("[") else []
    try:
        _plain_numbers(parts)
    except ValueError:
        return []
    return parts if len(parts) <= _LONGEST_LIST else []


def _spread(fields: list[str], sizes: Sequence[int]) -> list[str]:
    """Give each number of a list a field of its own, which are empty where the list is absent or of another length."""
    if len(fields) != len(sizes):
        return fields
    spread = []
    for field, size in zip(fields, sizes, strict=True):
        own = _listed(field) if size else [field]
        spread += own if len(own) == max(size, 1) else [""] * size
    return spread


def _delimiter(line: str) -> str:
    """Tell what parts the fields of a line; numbers with a decimal comma are parted by the others."""
    return next((each for each in ";\t," if each in line), " ")


def _rows(lines: Iterator[str], delimiter: str, before: int = 0) -> _Rows:
    """Give each row with the line on which it begins, after so many lines."""
    if delimiter == " ":
        yield from enumerate(map(str.split, lines), start=before + 1)
        return
    reader, begins = csv.reader(lines, delimiter=delimiter), before + 1
    for row in reader:
        yield begins, row
        # A field in quotes may go over several lines.
        begins = before + reader.line_num + 1


def _fields(line: str) -> list[str]:
    return next((own for _, own in _rows(iter([line]), _delimiter(line))), [])


def _refuse_inflated(path: Path) -> None:
    """Refuse a compressed log of more text than its numbers may make up."""
    # A number and what parts it from the next take two letters at least, and eight bytes.
    most, held = most_held(path.stat().st_size) // 4, 0
    with gzip.open(path) as raw:
        while part := raw.read(_LONGEST_LINE):
            held += len(part)
            if held > most:
                raise InputError(f"{path}: holds more than {most / 1e6:.3g} MB of text: damaged, or not a log")


def row_lines(path: Path) -> list[int]:
    """List the line number, from 1, on which each row of values in a CSV begins; empty lines hold none."""
    with _opened(path) as table:
        return [number for number, row in table.rows if row]


def _kind(text: str) -> str:
    """Tell a number, or nothing, from a time; empty for what is neither."""
    for kind, read in (("number", lambda own: _plain_numbers([own or "nan"])), ("time", _seconds)):
        try:
            read(text.strip())
        except ValueError:
            continue
        return kind
    return ""


def _seconds(text: str) -> float:
    """Read a date with a time, or a time of day, as ISO 8601 writes it; where no zone is named, as one of UTC."""
    if ":" not in text:
        raise ValueError(text)
    # An hour may have one digit, and slashes may part a date.
    dated, of_day = text.replace("/", "-").removesuffix(" UTC"), f"1970-01-01T{'0' * (text[1:2] == ':')}{text}"
    stamp = datetime.fromisoformat(dated if dated[4:5] == "-" else of_day)
    return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()


def number_of(field: str) -> float:
    """Read a number or a time; NaN of nothing."""
    text = field.strip()
    if not text:
        return float("nan")
    return _seconds(text) if ":" in text else _plain_numbers([text])[0]


def _number(field: str, path: Path, row: int, column: str) -> float:
    try:
        return number_of(field)
    except ValueError:
        raise InputError(f"{path}:{row}: column '{column}' = {field.strip()[:40]!r}: not a number") from None


def _plain_numbers(fields: list[str]) -> list[float]:
    # Python's own numbers may hold underscores and digits of any script; no log means such a number.
    together = "".join(fields)
    if "_" in together or not together.isascii():
        raise ValueError(together)
    return list(map(float, fields))
