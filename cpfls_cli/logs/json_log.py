"""Reader of JSON: lists of numbers by their path, with stamps of their own or without, and records, also one a line."""

import json
from collections.abc import Collection, Iterator
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.logs.formats import MOST_LISTED, LogContents
from cpfls_cli.logs.records import bytes_of
from cpfls_cli.words import some

_STAMPS = ("time", "timestamp", "t")  # What a list of stamps is called, of the lists next to it.
_NEAR = 0.55  # Of the clock's usual step; half of it would lose rows of stamps that lie between two, to rounding.


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
    try:
        listed = list(_lists("", _parsed(bytes_of(path).decode("utf-8-sig"))))
    except (ValueError, RecursionError, OverflowError) as error:
        raise InputError(f"{path}: cannot be read as JSON: {error}") from None
    if not listed:
        raise InputError(f"{path}: holds no lists of numbers and no records of them, as `[{{...}}, {{...}}]`")
    timed = [own for own in listed if own.stamps is not None]
    if len({own.stamps.tobytes() for own in timed if own.stamps is not None}) < 2:
        return LogContents({"": {own.name: own.values for own in listed}})
    rising = [own.stamps for own in timed if own.stamps is not None and np.all(np.diff(own.stamps) > 0)]
    clock = max(rising, key=lambda own: (sum(_meet(own, other) for other in rising), len(own)), default=np.empty(0))
    columns = {"time": clock}
    for own in timed:
        laid = np.empty(0) if own.values is own.stamps else _laid(own, clock)
        columns |= {own.name: laid} if np.isfinite(laid).any() else {}
    left = [own.name for own in listed if own.name not in columns and own.values is not own.stamps]
    words = f"of other stamps than most, and left out: {some(left, MOST_LISTED)}"
    return LogContents({"": columns}, warnings=(words,) if left else ())


def _parsed(text: str) -> Any:
    """Parse a text, or each line of one; a last line may have been cut."""
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        lines = [line for line in text.splitlines() if line.strip()]
        records = [json.loads(line) for line in lines[:-1]]
        if not records:
            raise
        try:
            return [*records, json.loads(lines[-1])]
        except json.JSONDecodeError:
            return records


def _lists(name: str, value: Any) -> Iterator[_Listed]:
    if isinstance(value, dict):
        numbers = {key: own for key in value if (own := _numbers(value[key])) is not None}
        clock = next((numbers[key] for key in numbers if key.lower() in _STAMPS), None)
        pair = clock is not None and len(value) == 2
        for key, own in value.items():
            path = f"{name}/{key}" if name else key
            if key not in numbers:
                yield from _lists(path, own)
            else:
                fits = clock is not None and len(numbers[key]) == len(clock)
                named = name if name and pair and numbers[key] is not clock else path
                yield _Listed(named, numbers[key], clock if fits else None)
    elif isinstance(value, list) and value and all(isinstance(own, dict) for own in value):
        rows = [dict(_leaves("", own)) for own in value]
        for key in dict.fromkeys(chain.from_iterable(rows)):
            yield _Listed(f"{name}/{key}" if name else key, np.array([row.get(key, np.nan) for row in rows]), None)
    elif (
        isinstance(value, list) and value and all(isinstance(own, list) and len(own) == len(value[0]) for own in value)
    ):
        for index, column in enumerate(map(_numbers, map(list, zip(*value, strict=True)))):
            if column is not None:
                yield _Listed(f"{name}[{index}]", column, None)


def _leaves(name: str, value: Any) -> Iterator[tuple[str, float]]:
    """Name the numbers of a record by their path."""
    if isinstance(value, int | float):
        yield name, float(value)
    for key, own in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        part = f"[{key}]" if isinstance(value, list) else f"/{key}" if name else key
        yield from _leaves(f"{name}{part}", own)


def _numbers(value: Any) -> Array | None:
    """Make an array of two numbers or more, absent ones as NaN; None of anything else."""
    if not isinstance(value, list) or len(value) < 2 or not all(isinstance(own, int | float | None) for own in value):
        return None
    return np.array([np.nan if own is None else own for own in value], dtype=float)


def _meet(one: Array, two: Array) -> bool:
    return bool(one[0] <= two[-1] and two[0] <= one[-1])


def _laid(own: _Listed, clock: Array) -> Array:
    stamps = own.stamps
    if stamps is None or len(clock) < 2 or not np.all(np.diff(stamps) > 0):
        return np.full(len(clock), np.nan)
    after = np.clip(np.searchsorted(stamps, clock), 1, len(stamps) - 1)
    apart = np.minimum(np.abs(clock - stamps[after - 1]), np.abs(stamps[after] - clock))
    return np.where(apart < _NEAR * np.median(np.diff(clock)), np.interp(clock, stamps, own.values), np.nan)
