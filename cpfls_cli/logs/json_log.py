"""Reader of JSON: lists of numbers by their path, with stamps of their own or without, and records, also one a line."""

import json
from collections.abc import Collection, Iterator
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.repair import increasing_rows
from cpfls_cli.logs.csv_log import number_of
from cpfls_cli.logs.formats import MOST_LISTED, TABLE_ENDS, LogContents
from cpfls_cli.logs.records import bytes_of
from cpfls_cli.words import some

_STAMPS = ("time", "timestamp", "t")  # What a list of stamps is called, of the lists next to it, best first.
_SELDOM = 0.1  # Share of stamps up to which some may repeat or fall; of more there are several flights, or no clock.
_NEAR = 0.55  # Of the clock's usual step; half of it would lose rows of stamps that lie between two, to rounding.
_THINNED = 1.5  # Times as often as the clock that a list has to come to be called thinned.
_JUMP = 0.5  # Share of a signal's range beyond which it jumps, as angles do by a turn: nothing lies between then.
_FORM = 'lists of numbers by name, `{"t": [...], ...}`, or records of them, `[{...}, {...}]`'

_DAMAGED = "damaged, cut short or not strict; copy or write it again"


class _Listed(NamedTuple):
    """A list of numbers, by its path, and the stamps next to it."""

    name: str
    values: Array
    stamps: Array | None


def contents(path: Path, wanted: Collection[str] | None = None) -> LogContents:
    """Read lists of numbers by their path, ``group/name``; keys of records are columns.

    Lists with stamps of their own, as a Crazyflie's client writes them, are laid on the longest that meet most others:
    a value is interpolated to the stamp that is nearest to its own, and NaN is where none is near.
    """
    del wanted  # A text is parsed as a whole.
    content = bytes_of(path)
    text = content.decode(json.detect_encoding(content), "replace").strip()
    if not text.startswith(("{", "[", "\x1e")):
        raise InputError(f"{path}: holds no JSON, which begins with {{ or [; {TABLE_ENDS}")
    try:
        listed = list(_lists("", _parsed(text)))
    except RecursionError:
        raise InputError(f"{path}: is nested too deeply for a log: write {_FORM}") from None
    except ValueError as error:
        raise InputError(f"{path}: cannot be read as JSON ({error}): {_DAMAGED}") from None
    if not listed:
        raise InputError(f"{path}: holds no numbers over time: write {_FORM}")
    timed = [own for own in listed if own.stamps is not None]
    if len({own.stamps.tobytes() for own in timed if own.stamps is not None}) < 2:
        return LogContents({"": {own.name: own.values for own in listed}})
    rising = [own.stamps[kept] for own in timed if own.stamps is not None and len(kept := _kept(own.stamps)) > 1]
    clock = max(rising, key=lambda own: (sum(_meet(own, other) for other in rising), len(own)), default=np.empty(0))
    columns = {"time": clock}
    for own in timed:
        laid = np.empty(0) if own.values is own.stamps else _laid(own, clock)
        columns |= {own.name: laid} if np.isfinite(laid).any() else {}
    left = [own.name for own in listed if own.name not in columns and own.values is not own.stamps]
    thinned = [own.name for own in timed if own.name in columns and _rate(own.stamps) > _THINNED * _rate(clock)]
    said = {
        "of other stamps than most, or of none that rise, and left out": left,
        "come more often than the stamps that most meet, and are thinned": thinned,
    }
    warnings = tuple(f"{words}: {some(names, MOST_LISTED)}" for words, names in said.items() if names)
    return LogContents({"": columns}, warnings=warnings)


def _parsed(text: str) -> Any:
    """Parse a text, or each line of one; a last line may have been cut."""
    # Numbers of any size; a mapping by 0, 1 and on is a list, as pandas writes its columns.
    loads = partial(json.loads, parse_int=float, object_hook=_uncounted)
    try:
        return loads(text)
    except json.JSONDecodeError as whole:
        records: list[Any] = []
        lines = [(number, line) for number, line in enumerate(text.split("\n"), 1) if line.strip()]
        for number, line in lines:
            try:
                records.append(loads(line.strip().removeprefix("\x1e")))
            except json.JSONDecodeError as error:
                if not records:
                    raise whole from None
                if number < lines[-1][0]:
                    raise ValueError(f"line {number}: {error.msg}") from None
        return records


def _uncounted(own: dict[str, Any]) -> Any:
    return [*own.values()] if len(own) > 1 and all(key == str(row) for row, key in enumerate(own)) else own


def _lists(name: str, value: Any) -> Iterator[_Listed]:
    if isinstance(value, dict):
        numbers = {key: own for key in value if (own := _numbers(value[key])) is not None}
        yield from _with_stamps(name, numbers, alone=len(value) == 2)
        for key in (key for key in value if key not in numbers):
            yield from _lists(f"{name}/{key}" if name else key, value[key])
    elif isinstance(value, list) and value and all(isinstance(own, dict) for own in value):
        rows = [dict(_leaves("", own)) for own in value]
        keys = dict.fromkeys(chain.from_iterable(rows))
        yield from _with_stamps(name, {key: np.array([row.get(key, np.nan) for row in rows]) for key in keys})
    elif (
        isinstance(value, list) and value and all(isinstance(own, list) and len(own) == len(value[0]) for own in value)
    ):
        if all(isinstance(own, str) for own in value[0]):
            yield from _lists(name, dict(zip(value[0], map(list, zip(*value[1:], strict=True)), strict=False)))
            return
        # Samples are along the longer axis.
        columns = value if len(value) < len(value[0]) else map(list, zip(*value, strict=True))
        for index, column in enumerate(map(_numbers, columns)):
            if column is not None:
                yield _Listed(f"{name}[{index}]", column, None)


def _with_stamps(name: str, columns: dict[str, Array], *, alone: bool = False) -> Iterator[_Listed]:
    """Give columns the stamps among them; one that is alone with them has the name of the pair."""
    stamps = [(stamp, own) for stamp in _STAMPS for key, own in columns.items() if key.lower() == stamp]
    # A T that falls is a temperature or a thrust.
    clocks = sorted(stamps, key=lambda pair: not len(_kept(pair[1])))
    clock = next((own for stamp, own in clocks if len(_kept(own)) > 1 or stamp != _STAMPS[-1]), None)
    for key, own in columns.items():
        fits = clock is not None and len(own) == len(clock)
        pair = name and alone and fits and own is not clock
        yield _Listed(name if pair else f"{name}/{key}" if name else key, own, clock if fits else None)


def _leaves(name: str, value: Any) -> Iterator[tuple[str, float]]:
    """Name the numbers of a record by their path."""
    if (known := _number(value)) is not None:
        yield name, known
    for key, own in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        part = f"[{key}]" if isinstance(value, list) else f"/{key}" if name else key
        yield from _leaves(f"{name}{part}", own)


def _number(value: Any) -> float | None:
    """Read a number or a time, also as text; None of anything else."""
    if isinstance(value, int | float):
        return float(value)
    try:
        return number_of(value) if isinstance(value, str) and value.strip() else None
    except ValueError:
        return None


def _numbers(value: Any) -> Array | None:
    """Make an array of a list with numbers in it, NaN for what is none; None of a single one and of anything else."""
    if not isinstance(value, list) or len(value) < 2 or any(isinstance(own, dict | list) for own in value):
        return None
    known = np.array([np.nan if (own := _number(each)) is None else own for each in value])
    return known if np.isfinite(known).any() else None


def _kept(stamps: Array) -> IntArray:
    """Choose the rows whose stamps rise; none where many do not."""
    kept, dropped = increasing_rows(stamps)
    wrong = dropped["repeated_time"] + dropped["backward_time"]
    return kept if wrong <= _SELDOM * len(stamps) else kept[:0]


def _rate(stamps: Array | None) -> float:
    return 0.0 if stamps is None or len(stamps) < 2 else 1 / float(np.nanmedian(np.diff(stamps)))


def _meet(one: Array, two: Array) -> bool:
    return bool(one[0] <= two[-1] and two[0] <= one[-1])


def _laid(own: _Listed, clock: Array) -> Array:
    nowhere = np.full(len(clock), np.nan)
    stamps = nowhere if own.stamps is None else np.where(np.isfinite(own.values), own.stamps, np.nan)
    kept = _kept(stamps)
    if min(len(clock), len(kept)) < 2:
        return nowhere
    stamps, values = stamps[kept], own.values[kept]
    after = np.clip(np.searchsorted(stamps, clock), 1, len(stamps) - 1)
    since, until = np.abs(clock - stamps[after - 1]), np.abs(stamps[after] - clock)
    jumps = np.abs(values[after] - values[after - 1]) > _JUMP * np.ptp(values)
    nearest = np.where(since < until, values[after - 1], values[after])
    laid = np.where(jumps, nearest, np.interp(clock, stamps, values))
    return np.where(np.minimum(since, until) < _NEAR * np.median(np.diff(clock)), laid, np.nan)
