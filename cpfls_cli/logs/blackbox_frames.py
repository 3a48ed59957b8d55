"""Compiled loops that read the frames of a blackbox log.

A frame holds for each field the difference to a prediction, packed by one of few encodings; the header says which. A
frame of kind I stands by itself, one of kind P builds on the two before it. Frames of GPS, events and slow fields are
stepped over.
"""

from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.compiling import compiled, part

Bytes = np.ndarray
KINDS = "IPGHS"  # Kinds of frames with fields: main, those between, GPS, home, slow.
MAIN = 0
SLOW = KINDS.index("S")
ROLLOVER = 1 << 32  # Stamps have 32 bits, microseconds.
_SIGNED, _UNSIGNED, _NEGATIVE, _EIGHT, _THREE, _FOUR, _NONE, _THREE_WIDE = 0, 1, 3, 6, 7, 8, 9, 10
ENCODINGS = (_SIGNED, _UNSIGNED, _NEGATIVE, _EIGHT, _THREE, _FOUR, _NONE, _THREE_WIDE)
_PREVIOUS, _STRAIGHT, _AVERAGE, _MINIMUM, _FIRST_MOTOR, _MIDDLE, _BATTERY, _MOTOR_MINIMUM = 1, 2, 3, 4, 5, 8, 9, 11
_INCREMENT = 6
_TIME = 1
_BETWEEN = 1
_MARKERS = np.frombuffer(KINDS.encode(), dtype=np.uint8)
_EVENT = ord("E")
_LONGEST_FRAME = 256
_LONGEST_STEP_US = 10_000_000
_END = np.frombuffer(b"End of log", dtype=np.uint8)
_LOG_END, _RESUMED, _ADJUSTED = 255, 14, 13
# Numbers of variable length, or bytes, that follow the kind of an event.
# Of known events: kind, and how many numbers of variable length and then bytes follow it.
_EVENTS = ((0, 1, 0), (14, 2, 0), (15, 1, 0), (30, 2, 0), (40, 1, 0), (10, 0, 5), (11, 0, 4), (12, 0, 8))
# Shift and number of bits of three numbers in three bytes, narrow and wide, by the tag in their first two bits.
_PACKED = np.array(
    [
        [[[20, 2], [18, 2], [16, 2]], [[16, 4], [12, 4], [8, 4]], [[16, 6], [8, 6], [0, 6]]],
        [[[20, 2], [18, 2], [16, 2]], [[17, 5], [12, 5], [8, 4]], [[14, 8], [7, 7], [0, 7]]],
    ]
)


class Fields(NamedTuple):
    """How the fields of each kind of frame are written."""

    counts: IntArray  # Shape (kind,); kinds in the order of `KINDS`.
    encoding: IntArray  # Shape (kind, field)
    predictor: IntArray
    is_signed: IntArray


@part
def _byte(data: Bytes, place: int) -> Any:
    return np.int64(data[place]) if place < len(data) else np.int64(0)


@part
def _extended(value: Any, bits: Any) -> Any:
    """Extend the sign of a number of few bits."""
    top = np.int64(1) << (bits - 1)
    return ((value & (2 * top - 1)) ^ top) - top


@part
def _unsigned(data: Bytes, place: int) -> tuple[Any, int]:
    value = np.int64(0)
    for number in range(5):
        byte = _byte(data, place)
        place += 1
        value |= (byte & 127) << (7 * number)
        if byte < 128:
            break
    return value & 0xFFFFFFFF, place


@part
def _signed(data: Bytes, place: int) -> tuple[Any, int]:
    value, place = _unsigned(data, place)
    return (value >> 1) ^ -(value & 1), place




@part
def _three(data: Bytes, place: int, values: IntArray, wide: bool) -> Any:
    """Read three numbers of few bits, as the tag in front of them says, or of one to four bytes, the least first."""
    first = _byte(data, place)
    tag = first >> 6
    if tag < 3:
        bits = (first << 16) | (_byte(data, place + 1) << 8) | _byte(data, place + 2)
        for number in range(3):
            shift, size = _PACKED[int(wide), tag, number]
            values[number] = _extended(bits >> shift, size)
        return place + 1 + tag
    place += 1
    for number in range(3):
        size = 1 + ((first >> (2 * number)) & 3)
        value = np.int64(0)
        for own in range(size):
            value |= _byte(data, place + own) << (8 * own)
        place += size
        values[number] = _extended(value, 8 * size)
    return place


@part
def _four(data: Bytes, place: int, values: IntArray) -> int:
    """Read four numbers of 0, 4, 8 or 16 bits, one close behind the other."""
    tag = _byte(data, place)
    begin = 2 * (place + 1)
    for number in range(4):
        size = (tag >> (2 * number)) & 3
        nibbles = 4 if size == 3 else size
        value = np.int64(0)
        for nibble in range(begin, begin + nibbles):
            byte = _byte(data, nibble // 2)
            value = (value << 4) | ((byte & 15) if nibble % 2 else (byte >> 4))
        values[number] = _extended(value, 4 * nibbles) if nibbles else 0
        begin += nibbles
    return (begin + 1) // 2


@part
def _group(data: Bytes, place: int, kind: int, first: int, fields: Fields, values: IntArray) -> tuple[int, int]:
    """Read the fields that are packed together from one on; how many they are, and where the next one begins."""
    how = fields.encoding[kind, first]
    if how in (_THREE, _THREE_WIDE):
        return 3, _three(data, place, values, how == _THREE_WIDE)
    if how == _FOUR:
        return 4, _four(data, place, values)
    if how == _EIGHT:
        size = 1
        while size < 8 and first + size < fields.counts[kind] and fields.encoding[kind, first + size] == _EIGHT:
            size += 1
        present: Any = np.int64(1)
        if size > 1:
            present = _byte(data, place)
            place += 1
        for number in range(size):
            values[number] = 0
            if (present >> number) & 1:
                values[number], place = _signed(data, place)
        return size, place
    values[0] = 0
    if how == _SIGNED:
        values[0], place = _signed(data, place)
    elif how == _UNSIGNED:
        values[0], place = _unsigned(data, place)
    elif how == _NEGATIVE:
        value, place = _unsigned(data, place)
        values[0] = -_extended(value, 14)
    return 1, place


@part
def _predicted(how: int, field: int, row: IntArray, before: IntArray, constants: IntArray) -> Any:
    """Predict a field from the two frames before and what the header states; 0 where nothing is predicted."""
    if how == _PREVIOUS:
        return before[0, field]
    if how == _STRAIGHT:
        return 2 * before[0, field] - before[1, field]
    if how == _AVERAGE:
        total = before[0, field] + before[1, field]
        # Halves are cut off towards zero.
        return (total + (total < 0)) >> 1
    if how == _MINIMUM:
        return constants[0]
    if how == _MOTOR_MINIMUM:
        return constants[1]
    if how == _BATTERY:
        return constants[2]
    if how == _FIRST_MOTOR:
        return row[constants[3]]
    return 1500 if how == _MIDDLE else 0


@part
def _frame(
    data: Bytes,
    place: int,
    kind: int,
    fields: Fields,
    before: IntArray,
    constants: IntArray,
    row: IntArray,
    values: IntArray,
) -> int:
    """Read the fields of a frame into a row; where the next frame begins."""
    count = fields.counts[kind]
    # Of one type from the start: with another, numba compiles what is called with it twice.
    field: Any = np.int64(0)
    while field < count:
        if fields.predictor[kind, field] == _INCREMENT:
            row[field] = before[0, field] + 1
            field += 1
            continue
        size, place = _group(data, place, kind, field, fields, values)
        for number in range(min(size, count - field)):
            value = values[number] + _predicted(fields.predictor[kind, field], field, row, before, constants)
            value &= 0xFFFFFFFF
            row[field] = _extended(value, 32) if fields.is_signed[kind, field] else value
            field += 1
    return place


@part
def _event(data: Bytes, place: int) -> tuple[int, int]:
    """Step over an event; its kind, -1 for none that is known, and where the next frame begins."""
    kind = _byte(data, place)
    place += 1
    if kind == _LOG_END:
        for number in range(len(_END)):
            if _byte(data, place + number) != _END[number]:
                return -1, place
        return kind, place + len(_END)
    if kind == _ADJUSTED:
        if _byte(data, place) >= 128:
            return kind, place + 5
        return kind, _unsigned(data, place + 1)[1]
    for known, count, size in _EVENTS:
        if kind == known:
            for _ in range(count):
                _, place = _unsigned(data, place)
            return kind, place + size
    return -1, place


@part
def _kind(marker: int) -> int:
    """Give the number of the kind of frame that a byte announces, len(KINDS) for an event, -1 for none."""
    for number in range(len(_MARKERS)):
        if marker == _MARKERS[number]:
            return number
    return len(_MARKERS) if marker == _EVENT else -1


def decode(
    data: Bytes, place: int, fields: Fields, constants: IntArray, rows: IntArray, slow: IntArray
) -> tuple[int, int, int]:
    """Count main frames, broken ones (that are none, or jump in time) and slow ones from where the header ends.

    The constants are least throttle, least motor output, reference of the battery, and the field of the first motor.
    Rows, shape (frame, field), and slow ones, shape (frame, 1 + field), are filled as far as they go; empty ones are
    counted alone. What changes slowly is behind the number of the main frame that comes next.
    """
    # Arrays are made here and copied by element: numba would compile the words of errors of shapes for two seconds.
    width = fields.encoding.shape[1]
    row, before, values = (np.zeros(shape, dtype=np.int64) for shape in (width, (2, width), 8))
    return _decoded(data, place, fields, constants, rows, slow, row, before, values)


@compiled
def _decoded(
    data: Bytes,
    place: int,
    fields: Fields,
    constants: IntArray,
    rows: IntArray,
    slow: IntArray,
    row: IntArray,
    before: IntArray,
    values: IntArray,
) -> tuple[int, int, int]:
    number, broken, changes, last, in_step, resumed = 0, 0, 0, np.int64(0), False, True
    while place < len(data):
        kind = _kind(data[place])
        event = -1
        if kind == len(_MARKERS):
            event, end = _event(data, place + 1)
        elif kind >= 0:
            end = _frame(data, place + 1, kind, fields, before, constants, row, values)
        if event == _LOG_END:
            break
        whole = kind >= 0 and (kind < len(_MARKERS) or event >= 0) and end - place <= _LONGEST_FRAME
        if not whole or end > len(data) or (end < len(data) and _kind(data[end]) < 0):
            # A cut end is no fault; what follows a fault is searched for the next frame.
            broken += 0 if end > len(data) or not in_step else 1
            in_step = False
            place += 1
            continue
        place = end
        resumed = resumed or event == _RESUMED
        if kind == SLOW:
            if changes < len(slow):
                slow[changes, 0] = number
                for field in range(slow.shape[1] - 1):
                    slow[changes, 1 + field] = row[field]
            changes += 1
        if kind != MAIN and (kind != _BETWEEN or not in_step):
            continue
        step = (row[_TIME] - last) & (ROLLOVER - 1)
        if kind == MAIN or step <= _LONGEST_STEP_US:
            last = row[_TIME]
        if step > _LONGEST_STEP_US and not resumed:
            broken += 1 if in_step else 0
            in_step = False
            continue
        in_step, resumed = True, False
        for field in range(len(row)):
            before[1, field] = row[field] if kind == MAIN else before[0, field]
            before[0, field] = row[field]
        if number < len(rows):
            for field in range(rows.shape[1]):
                rows[number, field] = row[field]
        number += 1
    return number, broken, changes
