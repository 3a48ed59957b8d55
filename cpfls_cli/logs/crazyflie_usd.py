"""Reader of what a Crazyflie writes on its micro SD card: events, each with stamps and variables of its own."""

import struct
from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

import numpy as np

from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.topics import STAMP
from cpfls_cli.logs.formats import LogContents
from cpfls_cli.logs.records import bytes_of, numbers, seconds, table

# Type of the stamps and how many there are in a second, by version of the format.
_STAMPS = {1: ("<u4", 10**3), 2: ("<u8", 10**6)}
_NUMBER = 2
_CHECK_SUM = 4
_LETTERS = "BbHhIiQqefd"  # Types of numbers that a log may hold.


class _Event(NamedTuple):
    """One kind of event: its variables, packed behind number and stamp, and where the samples begin."""

    name: str
    kind: np.dtype
    begins: list[int]


def contents(path: Path, wanted: Collection[str] | None = None) -> LogContents:
    """Read all events, ``event.group.variable``; such a log is small."""
    del wanted
    content = bytes_of(path)
    whole = crc32(content[:-_CHECK_SUM]) == int.from_bytes(content[-_CHECK_SUM:], "little")
    try:
        version, events, begin = _header(content)
    except (ValueError, IndexError, TypeError, struct.error) as error:
        raise InputError(f"{path}: a broken log of a Crazyflie's uSD card: its header: {error}") from None
    if version not in _STAMPS:
        raise InputError(f"{path}: a log of a Crazyflie's uSD card of version {version}; only 1 and 2 can be read")
    _find_samples(content[: -_CHECK_SUM if whole else None], begin, events)
    tables = {event.name: table(content, event.begins, event.kind) for event in events.values() if event.begins}
    if not tables:
        raise InputError(f"{path}: holds no samples")
    origin = min(int(samples[STAMP][0]) for samples in tables.values())
    topics = {
        name: {
            STAMP: seconds(samples[STAMP], origin, _STAMPS[version][1]),
            **{each: numbers(samples[each]) for each in (samples.dtype.names or ())[2:]},
        }
        for name, samples in tables.items()
    }
    begins = {"": origin / _STAMPS[version][1]}
    broken = "the checksum is wrong: the file is cut off or damaged; what could be read is used"
    return LogContents(topics, system="Crazyflie uSD", warnings=() if whole else (broken,), begins=begins)


def _header(content: bytes) -> tuple[int, dict[int, _Event], int]:
    """Read version, events by their numbers, and where the samples begin."""
    version, count = struct.unpack_from("<HH", content, 1)
    events, place = {}, 1 + 4
    for _ in range(count if version in _STAMPS else 0):
        (number,) = struct.unpack_from("<H", content, place)
        name, place = _text(content, place + 2)
        (variables,) = struct.unpack_from("<H", content, place)
        place += 2
        fields = [("", "<u2"), (STAMP, _STAMPS[version][0])]
        for _ in range(variables):
            # A name and the letter of its type, as in group.name(f).
            variable, place = _text(content, place)
            letter = variable[-2]
            if letter not in _LETTERS:
                raise ValueError(f"the type {letter!r} of {variable}")
            fields.append((variable[:-3], f"<{np.dtype(letter).str[1:]}"))
        events[number] = _Event(name, np.dtype(fields), [])
    return version, events, place


def _text(content: bytes, place: int) -> tuple[str, int]:
    end = content.index(b"\0", place)
    return content[place:end].decode(), end + 1


def _find_samples(content: bytes, place: int, events: dict[int, _Event]) -> None:
    """Note where each sample begins, up to the first that is none or is not whole."""
    while place + _NUMBER <= len(content):
        event = events.get(int.from_bytes(content[place : place + _NUMBER], "little"))
        if event is None or place + event.kind.itemsize > len(content):
            return
        event.begins.append(place)
        place += event.kind.itemsize
