"""Blackbox logs, written frame by frame from the public description of the format."""

import numpy as np

PRODUCT = "Blackbox flight data recorder by Nicholas Sherlock"
# Name, signed, then predictor and encoding in frames of kind I and of kind P.
FIELDS = [
    ("loopIteration", 0, (0, 1), (6, 9)),
    ("time", 0, (0, 1), (2, 0)),
    ("axisI[0]", 1, (0, 0), (1, 7)),
    ("axisI[1]", 1, (0, 0), (1, 7)),
    ("axisI[2]", 1, (0, 0), (1, 7)),
    ("rcCommand[0]", 1, (0, 0), (1, 8)),
    ("rcCommand[1]", 1, (0, 0), (1, 8)),
    ("rcCommand[2]", 1, (0, 0), (1, 8)),
    ("rcCommand[3]", 0, (4, 1), (1, 8)),
    ("axisF[0]", 1, (0, 0), (1, 10)),
    ("axisF[1]", 1, (0, 0), (1, 10)),
    ("axisF[2]", 1, (0, 0), (1, 10)),
    ("vbatLatest", 0, (9, 3), (1, 6)),
    ("amperageLatest", 1, (0, 0), (1, 6)),
    ("gyroADC[0]", 1, (0, 0), (3, 0)),
    ("accSmooth[2]", 1, (0, 0), (3, 0)),
    ("debug[0]", 1, (8, 0), (1, 6)),
    ("motor[0]", 0, (11, 1), (3, 0)),
    ("motor[1]", 0, (5, 0), (3, 0)),
    ("eRPM[0]", 0, (0, 1), (1, 0)),
]
NAMES = [name for name, *_ in FIELDS]
FACTS = {
    "Firmware type": "Cleanflight",
    "Firmware revision": "Betaflight 4.5.1 (77d01ba3b) STM32F7X2",
    "minthrottle": "1070",
    "motorOutput": "158,2047",
    "gyro_scale": "0x3f800000",
    "acc_1G": "2048",
    "vbatref": "1600",
    "motor_poles": "14",
}
MINIMUM, MOTOR, BATTERY = 1070, 158, 1600
NOTHING = ((0,) * len(FIELDS),) * 2


def unsigned(value):
    value &= 0xFFFFFFFF
    parts = []
    while value > 127:
        parts.append(value & 127 | 128)
        value >>= 7
    return bytes([*parts, value])


def signed(value):
    return unsigned((value << 1) ^ (value >> 31))


def fits(values, *bits):
    return all(-(1 << size - 1) <= value < 1 << size - 1 for value, size in zip(values, bits, strict=True))


def whole_bytes(values):
    sizes = [next(size for size in (1, 2, 3, 4) if fits([value], 8 * size)) for value in values]
    tag = 0xC0 | sum(size - 1 << 2 * place for place, size in enumerate(sizes))
    return bytes([tag]) + b"".join(
        (value & 0xFFFFFFFF).to_bytes(4, "little")[:size] for value, size in zip(values, sizes, strict=True)
    )


def three(values):
    a, b, c = values
    if fits(values, 2, 2, 2):
        return bytes([(a & 3) << 4 | (b & 3) << 2 | c & 3])
    if fits(values, 4, 4, 4):
        return bytes([0x40 | a & 15, (b & 15) << 4 | c & 15])
    return bytes([0x80 | a & 63, b & 63, c & 63]) if fits(values, 6, 6, 6) else whole_bytes(values)


def three_wide(values):
    a, b, c = values
    if fits(values, 2, 2, 2):
        return bytes([(a & 3) << 4 | (b & 3) << 2 | c & 3])
    if fits(values, 5, 5, 4):
        return (0x4000 | (a & 31) << 9 | (b & 31) << 4 | c & 15).to_bytes(2, "big")
    if fits(values, 8, 7, 7):
        return (0x800000 | (a & 255) << 14 | (b & 127) << 7 | c & 127).to_bytes(3, "big")
    return whole_bytes(values)


def four(values):
    sizes = [0 if not value else next(n for n in (1, 2, 3) if fits([value], (4, 8, 16)[n - 1])) for value in values]
    digits = [
        value >> 4 * place & 15
        for value, size in zip(values, sizes, strict=True)
        for place in reversed(range((0, 1, 2, 4)[size]))
    ]
    digits += [0] * (len(digits) % 2)
    packed = [high << 4 | low for high, low in zip(digits[::2], digits[1::2], strict=True)]
    return bytes([sum(size << 2 * place for place, size in enumerate(sizes)), *packed])


def eight(values):
    if len(values) == 1:
        return signed(values[0])
    tag = sum(1 << place for place, value in enumerate(values) if value)
    return bytes([tag]) + b"".join(signed(value) for value in values if value)


GROUPS = {7: (3, three), 8: (4, four), 10: (3, three_wide), 6: (8, eight)}
SINGLE = {0: signed, 1: unsigned, 3: lambda value: unsigned(-value & 0x3FFF), 9: lambda _: b""}


def predicted(how, place, row, before):
    last, other = before
    return {
        0: 0,
        1: last[place],
        2: 2 * last[place] - other[place],
        3: int((last[place] + other[place]) / 2),
        4: MINIMUM,
        5: row[NAMES.index("motor[0]")],
        6: row[place],
        8: 1500,
        9: BATTERY,
        11: MOTOR,
    }[how]


def frame(kind, row, before=NOTHING):
    codes = [own[2 if kind == "I" else 3] for own in FIELDS]
    left = [
        value - predicted(how, place, row, before)
        for place, (value, (how, _)) in enumerate(zip(row, codes, strict=True))
    ]
    parts, place = [kind.encode()], 0
    while place < len(left):
        encoding = codes[place][1]
        most, pack = GROUPS.get(encoding, (1, None))
        size = next(
            (n for n in range(1, most) if codes[place + n : place + n + 1] == [] or codes[place + n][1] != encoding),
            most,
        )
        parts.append(pack(left[place : place + size]) if pack else SINGLE[encoding](left[place]))
        place += size
    return b"".join(parts)


def header(**changes):
    lines = {"Product": PRODUCT, "Data version": "2", "I interval": "8", "P interval": "1/1"}
    lines["Field I name"] = ",".join(NAMES)
    lines["Field I signed"] = ",".join(str(own[1]) for own in FIELDS)
    for kind, place in (("I", 2), ("P", 3)):
        lines[f"Field {kind} predictor"] = ",".join(str(own[place][0]) for own in FIELDS)
        lines[f"Field {kind} encoding"] = ",".join(str(own[place][1]) for own in FIELDS)
    lines |= {
        "Field S name": "flags,phase",
        "Field S signed": "0,0",
        "Field S predictor": "0,0",
        "Field S encoding": "1,7",
    }
    lines |= FACTS | {key.replace("_", " ") if key == "Data_version" else key: value for key, value in changes.items()}
    return "".join(f"H {key}:{value}\n" for key, value in lines.items() if value is not None).encode()


SLOW = b"S" + unsigned(300) + three([1, 0, -1])
BEEP = b"E\x00" + unsigned(123_456)
RESUMED = b"E\x0e" + unsigned(4_000) + unsigned(90_000_000)
END = b"E\xffEnd of log\x00"


def flight(count=60, begin_us=0xFFFFFFFF - 20_000, seed=1):
    """Values of all fields by frame; the clock, of 32 bits, runs over."""
    generator = np.random.default_rng(seed)
    # Steps of few and of many bits, as the encodings have them.
    widths = 2.0 ** generator.integers(0, 13, (count, len(FIELDS)))
    rows = np.cumsum(np.round(generator.normal(size=widths.shape) * widths), axis=0).astype(np.int64)
    unsigned_ones = np.array([not own[1] for own in FIELDS])
    rows[:, unsigned_ones] = np.abs(rows[:, unsigned_ones])
    rows[:, NAMES.index("rcCommand[3]")] += MINIMUM
    rows[:, NAMES.index("vbatLatest")] = BATTERY - generator.integers(0, 100, count)
    for place in [NAMES.index(f"rcCommand[{axis}]") for axis in range(4)]:
        rows[:, place] = np.clip(rows[:, place], -500, 2000)
    rows[:, 0] = np.arange(count)
    rows[:, 1] = (begin_us + 500 * np.arange(count) + generator.integers(0, 40, count)) & 0xFFFFFFFF
    return rows


def frames(rows):
    parts = []
    before = None
    for number, row in enumerate(rows.tolist()):
        main = number % 8 == 0
        parts.append(frame("I", row) if main else frame("P", row, before))
        before = (row, row) if main else (row, before[0])
    return parts
