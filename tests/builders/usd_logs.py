"""Logs of a Crazyflie's uSD card, written byte by byte as its firmware does."""

import struct
from zlib import crc32


def text(name):
    return name.encode() + b"\0"


def event(number, name, variables):
    """Describe an event: its variables by name, with the letters of their types."""
    own = b"".join(text(f"{variable}({kind})") for variable, kind in variables.items())
    return struct.pack("<H", number) + text(name) + struct.pack("<H", len(variables)) + own


def usd(events, samples, version=2, whole=True):
    """Write a log of events, variables and their letters by name, from samples: name of event, stamp, values."""
    numbers = {name: 7 + place for place, name in enumerate(events)}
    content = b"\xbc" + struct.pack("<HH", version, len(events))
    content += b"".join(event(numbers[name], name, variables) for name, variables in events.items())
    stamp = "I" if version == 1 else "Q"
    content += b"".join(
        struct.pack(f"<H{stamp}{''.join(events[name].values())}", numbers[name], when, *values)
        for name, when, values in samples
    )
    return content + struct.pack("<I", crc32(content) if whole else 0)
