"""The frames of a blackbox log.

A frame holds for each field the difference to a prediction, packed by one of few encodings; the header says which. A
frame of kind I stands by itself, one of kind P builds on the two before it. Frames of GPS, events and slow fields are
stepped over. What reads the frames of a kind is written for each header as plain Python, field by field: a log is read
in less time than a compiler takes to start.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from cpfls_cli.arrays import IntArray

KINDS = "IPGHS"  # Kinds of frames with fields: main, those between, GPS, home, slow.
ROLLOVER = 1 << 32  # Stamps have 32 bits, microseconds.
_SIGNED, _UNSIGNED, _NEGATIVE, _EIGHT, _THREE, _FOUR, _NONE, _THREE_WIDE = 0, 1, 3, 6, 7, 8, 9, 10
ENCODINGS = (_SIGNED, _UNSIGNED, _NEGATIVE, _EIGHT, _THREE, _FOUR, _NONE, _THREE_WIDE)
_INCREMENT = 6
_TIME = 1
_LONGEST_STEP_US = 10_000_000
_LONGEST_EVENT = 16  # Bytes.
_TOGETHER = 4096  # Rows that are made an array at a time.
_END: Final = b"End of log"
_LOG_END, _RESUMED, _ADJUSTED = 255, 14, 13
# Of events by their kind, how many numbers of variable length and then bytes follow it.
_EVENTS: Final = {0: (1, 0), 14: (2, 0), 15: (1, 0), 30: (2, 0), 40: (1, 0), 10: (0, 5), 11: (0, 4), 12: (0, 8)}
# Shift and number of bits of three numbers in three bytes, by the tag in their first two bits; of wide ones.
_NARROW_BITS: Final = (((20, 2), (18, 2), (16, 2)), ((16, 4), (12, 4), (8, 4)), ((16, 6), (8, 6), (0, 6)))
_WIDE_BITS: Final = (_NARROW_BITS[0], ((17, 5), (12, 5), (8, 4)), ((14, 8), (7, 7), (0, 7)))
# The same as shift, mask and highest bit.
_NARROW, _WIDE = (
    tuple(tuple((shift, (1 << size) - 1, 1 << (size - 1)) for shift, size in tag) for tag in packed)
    for packed in (_NARROW_BITS, _WIDE_BITS)
)
# What is read of a frame: where the next one begins, and the values. It is given the data, where the frame begins, and
# the values of the frame before and of the one before that.
Reader = Callable[[bytes, int, Sequence[int], Sequence[int]], tuple[int, tuple[int, ...]]]


class Field(NamedTuple):
    """How a field of a kind of frame is written."""

    encoding: int
    predictor: int
    is_signed: int


class Constants(NamedTuple):
    """What predictions take from the header: least throttle and motor output, the battery, the first motor's field."""

    throttle: int
    motor: int
    battery: int
    first_motor: int


def _extended(value: int, bits: int) -> int:
    """Extend the sign of a number of few bits."""
    top = 1 << (bits - 1)
    return ((value & (2 * top - 1)) ^ top) - top


def _unsigned(data: bytes, value: int, place: int) -> tuple[int, int]:
    """Read a number of variable length from its first byte on, seven bits a byte, the least first."""
    if value > 127:
        value &= 127
        for shift in (7, 14, 21, 28):
            byte = data[place]
            place += 1
            value |= (byte & 127) << shift
            if byte < 128:
                break
    return value & 0xFFFFFFFF, place


def _three(data: bytes, place: int, packed: tuple[tuple[tuple[int, int, int], ...], ...]) -> tuple[int, int, int, int]:
    """Read three numbers of few bits, as the tag in front of them says, or of one to four bytes, the least first."""
    sizes = data[place]
    tag = sizes >> 6
    if tag < 3:
        bits = sizes << 16 | data[place + 1] << 8 | data[place + 2]
        (by, mask, top), (by_2, mask_2, top_2), (by_3, mask_3, top_3) = packed[tag]
        first, second, third = (
            (bits >> by & mask) ^ top,
            (bits >> by_2 & mask_2) ^ top_2,
            (bits >> by_3 & mask_3) ^ top_3,
        )
        return first - top, second - top_2, third - top_3, place + 1 + tag
    found = []
    place += 1
    for number in range(3):
        size = 1 + ((sizes >> (2 * number)) & 3)
        found.append(int.from_bytes(data[place : place + size], "little", signed=True))
        place += size
    return found[0], found[1], found[2], place


def _four(data: bytes, place: int) -> tuple[int, int, int, int, int]:
    """Read four numbers of 0, 4, 8 or 16 bits, one close behind the other."""
    sizes = [(0, 4, 8, 16)[(data[place] >> (2 * number)) & 3] for number in range(4)]
    length = (sum(sizes) + 7) // 8
    bits, left = int.from_bytes(data[place + 1 : place + 1 + length], "big"), 8 * length
    found = []
    for size in sizes:
        left -= size
        found.append(_extended(bits >> left, size) if size else 0)
    return found[0], found[1], found[2], found[3], place + 1 + length


_READ: Final = ("b = data[p]", "p += 1", "if b > 127: b, p = unsigned(data, b, p)")
_VALUES: Final = {
    _SIGNED: "(b >> 1) ^ -(b & 1)",
    _EIGHT: "(b >> 1) ^ -(b & 1)",
    _UNSIGNED: "b",
    _NEGATIVE: "-extended(b, 14)",
}
# Several numbers that are packed together: how many, and what reads them.
_PACKED: Final = {
    _THREE: (3, "v0, v1, v2, p = three(data, p, narrow)"),
    _THREE_WIDE: (3, "v0, v1, v2, p = three(data, p, wide)"),
    _FOUR: (4, "v0, v1, v2, v3, p = four(data, p)"),
    _NONE: (1, "v0 = 0"),
}
_KNOWN: Final = {
    "unsigned": _unsigned, "extended": _extended, "three": _three, "four": _four, "narrow": _NARROW, "wide": _WIDE
}  # fmt: skip


def reader(fields: Sequence[Field], constants: Constants) -> Reader:
    """Write what reads the frames of a kind: every field on a line of its own, as its encoding and prediction say."""
    lines, first = ["def read(data, p, before, earlier):"], 0
    while first < len(fields):
        how, predictor, _ = fields[first]
        if predictor == _INCREMENT:
            lines.append(f" r{first} = before[{first}] + 1")
            first += 1
            continue
        if how in _PACKED:
            size, line = _PACKED[how]
            lines.append(f" {line}")
        else:
            together = (number for number, own in enumerate(fields[first:]) if own.encoding != _EIGHT)
            size = min(8, next(together, len(fields) - first)) if how == _EIGHT else 1
            lines += [" h = data[p]", " p += 1"] if size > 1 else []
            for number in range(size):
                read = (*_READ, f"v{number} = {_VALUES[how]}")
                held = [f" v{number} = 0", f" if h & {1 << number}:"] if size > 1 else []
                lines += [*held, *(f"{'  ' if held else ' '}{line}" for line in read)]
        for at, (_, way, is_signed) in enumerate(fields[first : first + size], start=first):
            value, half, add = f"v{at - first}", ROLLOVER // 2 * bool(is_signed), _predicted(way, at, constants)
            # What is written with a sign, and nothing is added to, has 32 bits as it is.
            free = is_signed and add == "0" and how != _UNSIGNED
            lines.append(f" r{at} = {value if free else f'({value} + {add} + {half} & {ROLLOVER - 1}) - {half}'}")
        first += size
    lines.append(f" return p, ({''.join(f'r{number}, ' for number in range(len(fields)))})")
    space: dict[str, Any] = dict(_KNOWN)
    exec("\n".join(lines), space)
    read_frame: Reader = space["read"]
    return read_frame


def _predicted(how: int, field: int, constants: Constants) -> str:
    """Write the prediction of a field; 0 where nothing is predicted."""
    both = f"before[{field}] + earlier[{field}]"
    ways = {
        1: f"before[{field}]",
        2: f"2 * before[{field}] - earlier[{field}]",
        # Halves are cut off towards zero.
        3: f"({both} + ({both} < 0) >> 1)",
        4: str(constants.throttle),
        5: f"r{constants.first_motor}" if 0 <= constants.first_motor < field else "0",
        8: "1500",
        9: str(constants.battery),
        11: str(constants.motor),
    }
    return ways.get(how, "0")


def _event(data: bytes, place: int) -> tuple[int, int]:
    """Step over an event; its kind, -1 for none that is known, and where the next frame begins."""
    kind, place = data[place], place + 1
    if kind == _LOG_END:
        ends = data.startswith(_END, place)
        return (kind, place + len(_END)) if ends else (-1, place)
    if kind == _ADJUSTED:
        return kind, place + 5 if data[place] >= 128 else _unsigned(data, data[place + 1], place + 2)[1]
    if kind not in _EVENTS:
        return -1, place
    count, size = _EVENTS[kind]
    for _ in range(count):
        _, place = _unsigned(data, data[place], place + 1)
    return kind, place + size


def decode(
    content: bytes, place: int, fields: Mapping[str, Sequence[Field]], constants: Constants
) -> tuple[IntArray, IntArray, int]:
    """Read frames from where the header ends.

    Main frames, shape (frame, field); slow ones, shape (frame, 1 + field), behind the number of the main frame that
    comes next; and how many are broken, that are none, or jump in time.
    """
    length, width = len(content), max(map(len, fields.values()))
    # Beyond its end a frame that is cut is read as 0.
    data = content + bytes(8 * width + _LONGEST_EVENT)
    # A kind that the header has no fields of is in no frame.
    readers = {ord(kind): reader(own, constants) for kind, own in fields.items() if own}
    main, between, slow, event_marker = map(ord, "IPSE")
    markers = {*readers, event_marker}
    rows: list[tuple[int, ...]] = []
    changes: list[tuple[int, ...]] = []
    # Tuples of numbers take several times as much as arrays do.
    parts: list[IntArray] = []
    before = earlier = row = (0,) * width
    broken, last, in_step, resumed = 0, 0, False, True
    while place < length:
        kind, event = data[place], -1
        whole = kind in markers
        if kind == event_marker:
            event, end = _event(data, place + 1)
            whole = event >= 0
        elif whole:
            end, row = readers[kind](data, place + 1, before, earlier)
        if event == _LOG_END:
            break
        if not whole or end > length or (end < length and data[end] not in markers):
            # A cut end is no fault; what follows a fault is searched for the next frame.
            broken += in_step and not (kind in markers and end > length)
            in_step = False
            place += 1
            continue
        place = end
        resumed = resumed or event == _RESUMED
        # What looks like one behind a fault is most often none.
        if kind == slow and (in_step or not broken):
            changes.append((len(parts) * _TOGETHER + len(rows), *row))
        if kind != main and (kind != between or not in_step):
            continue
        step = (row[_TIME] - last) % ROLLOVER
        if kind == main or step <= _LONGEST_STEP_US:
            last = row[_TIME]
        if step > _LONGEST_STEP_US and not resumed:
            broken += in_step
            in_step = False
            continue
        in_step, resumed = True, False
        row += (0,) * (width - len(row))
        before, earlier = row, row if kind == main else before
        rows.append(row)
        if len(rows) == _TOGETHER:
            parts.append(np.array(rows, dtype=np.int64))
            rows.clear()
    found = np.concatenate([*parts, np.array(rows, dtype=np.int64).reshape(len(rows), width)])
    held = np.array(changes, dtype=np.int64).reshape(len(changes), 1 + len(fields["S"]))
    return found[:, : len(fields["I"])], held, broken
