"""ULog files, written byte by byte from the public description of the format."""

import struct

import numpy as np

BEGIN = 3_600_000_000
"""Stamp of the file's header, microseconds."""


def message(kind, content):
    return struct.pack("<HB", len(content), ord(kind)) + content


def header():
    return b"ULog\x01\x12\x35\x01" + struct.pack("<Q", BEGIN)


def fact(key, value):
    """A line of information, or with a number in 32 bits a parameter."""
    if isinstance(value, str):
        key, content = f"char[{len(value)}] {key}", value.encode()
        return message("I", bytes([len(key)]) + key.encode() + content)
    kind, code = ("uint32_t", "I") if key.startswith("ver_") else ("float", "P")
    content = struct.pack("<I" if kind == "uint32_t" else "<f", value)
    return message(code, bytes([len(f"{kind} {key}")]) + f"{kind} {key}".encode() + content)


def definitions(fields, facts=None, nested=None):
    """Definitions of topics, by name or ``name[instance]``, numbered in their order, and of what is nested in them."""
    described = fields | (nested or {})
    formats = [message("F", f"{name}:{own};".encode()) for name, own in described.items() if "[" not in name]
    added = []
    for number, topic in enumerate(fields):
        name, _, instance = topic.partition("[")
        added.append(
            message("A", struct.pack("<BH", int(instance[:-1] or 0) if instance else 0, number) + name.encode())
        )
    known = [fact(key, value) for key, value in (facts or {}).items()]
    return b"".join([message("B", bytes(40)), *formats, *known, *added])


def data(stamp, number, values):
    """One sample: stamp from the header's, microseconds, number of the topic, single-precision values."""
    return message("D", struct.pack("<HQ", number, BEGIN + stamp) + np.asarray(values, "<f4").tobytes())


def ulog(sent, fields, facts=None, nested=None):
    return header() + definitions(fields, facts, nested) + b"".join(data(*row) for row in sent)
