"""DataFlash logs of ArduPilot, written byte by byte from the public description of the format."""

import struct

HEAD = b"\xa3\x95"
_LENGTHS = {"n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B", "g": "e"}
_FACTORS = {"c": 0.01, "C": 0.01, "e": 0.01, "E": 0.01, "L": 1e-7}


def packing(letters):
    return "<" + "".join(_LENGTHS.get(letter, letter) for letter in letters)


def message(number, letters, values):
    return HEAD + bytes([number]) + struct.pack(packing(letters), *values)


def definition(number, name, letters, columns):
    """Describe one kind of message, as such a log does before the first of them."""
    length = 3 + struct.calcsize(packing(letters))
    return message(0x80, "BBnNZ", (number, length, name.encode(), letters.encode(), columns.encode()))


def line(name, letters, values):
    """Write a message as ground stations turn it into text: numbers with the factor of their letter."""
    texts = (
        each.decode()
        if isinstance(each, bytes)
        else repr(round(_FACTORS[letter] * each, 9) if letter in _FACTORS else each)
        for letter, each in zip(letters, values, strict=True)
    )
    return f"{', '.join((name, *texts))}\n".encode()


def dataflash(kinds, rows, parameters=None, said=(), units=None, *, text=False):
    """Write a log, in bytes or as text.

    By name `kinds` are letters and columns as one text, and `units` letters of units and of factors; `said` are
    messages to the pilot.
    """
    kinds = {
        "PARM": ("QNf", "TimeUS,Name,Value"),
        "MSG": ("QZ", "TimeUS,Message"),
        "UNIT": ("QbZ", "TimeUS,Id,Label"),
        "FMTU": ("QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
    } | kinds
    numbers = {name: 129 + place for place, name in enumerate(kinds)}
    parts = [definition(0x80, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")]
    parts += [definition(numbers[name], name, *own) for name, own in kinds.items()]
    if text:
        formats = {"FMT": (0x80, "BBnNZ", "Type,Length,Name,Format,Columns")}
        formats |= {name: (numbers[name], *own) for name, own in kinds.items()}
        parts = [f"FMT, {own[0]}, 89, {name}, {own[1]}, {own[2]}\n".encode() for name, own in formats.items()]

    def put(name, *values):
        letters = kinds[name][0]
        parts.append(line(name, letters, values) if text else message(numbers[name], letters, values))

    for letter, label in (("s", "s"), ("E", "rad/s"), ("o", "m/s/s"), ("d", "deg"), ("Y", "us"), ("#", "instance")):
        if units is not None:
            put("UNIT", 1, ord(letter), label.encode())
    for name, (ids, factors) in (units or {}).items():
        put("FMTU", 1, numbers[name], ids.encode(), factors.encode())
    for name, value in (parameters or {}).items():
        put("PARM", 1, name.encode(), value)
    for words in said:
        put("MSG", 1, words.encode())
    for name, values in rows:
        put(name, *values)
    return b"".join(parts)
