"""Files that are no logs that can be read: what they are by their content, and how to get a log from them."""

import re
from pathlib import Path
from typing import Final, NamedTuple

_FIRST_BYTES = 1024


class _Foreign(NamedTuple):
    """A kind of file: what it begins with, at which place, what it is called, and the way to a log."""

    begins: bytes
    what: str
    way: str
    at: int = 0


_UNPACK: Final = "unpack it first, and give the log inside"
_CONVERT_TLOG: Final = (
    "telemetry is too slow for a model; give the log that the autopilot writes itself (.bin of ArduPilot, .ulg of PX4)"
)
_SLOW: Final = (
    "it comes twice a second or so, which is too slow; give the log that the flight controller writes itself (.bbl,"
    " .bin, .ulg)"
)
_CONVERT_SDLOG2: Final = (
    "convert it to CSV with sdlog2_dump.py of that firmware, or update the firmware, which then writes .ulg"
)
_TABLE: Final = (
    _Foreign(b"#ROSBAG V", "a bag of ROS 1", "make a bag of ROS 2 of it with rosbags-convert (package rosbags)"),
    _Foreign(b"PK\x03\x04", "a zip archive", _UNPACK),
    _Foreign(b"\x1f\x8b", "data compressed by gzip", _UNPACK),
    _Foreign(b"BZh", "data compressed by bzip2", _UNPACK),
    _Foreign(b"\xfd7zXZ\x00", "data compressed by xz", _UNPACK),
    _Foreign(b"7z\xbc\xaf\x27\x1c", "a 7z archive", _UNPACK),
    _Foreign(b"Rar!", "a rar archive", _UNPACK),
    _Foreign(b"\x28\xb5\x2f\xfd", "data compressed by zstd", _UNPACK),
    _Foreign(b"ustar", "a tar archive", _UNPACK, 257),
    _Foreign(b"\x93NUMPY", "an array of NumPy", "write it as CSV, HDF5 or .mat, with a name for each column"),
    _Foreign(b"version https://git-lfs", "a pointer of Git LFS", "fetch it with `git lfs pull`"),
    _Foreign(b"BUILD", "a .DAT of DJI", "convert it to CSV with DatCon or its like", 16),
    _Foreign(b"\xa3\x95\x80", "a log of PX4 before ULog (sdlog2)", _CONVERT_SDLOG2),
    _Foreign(b"%PDF", "a PDF", "give the log that it shows"),
    _Foreign(b"\x89PNG", "a picture", "give the log that it shows"),
    _Foreign(b"\xff\xd8\xff", "a picture", "give the log that it shows"),
)
_TRACK: Final = "a track of positions holds no motion of the body; give the log of the autopilot"
_AS_CSV: Final = "write its numbers as CSV, with a line of column names"
_TEXTS: Final = (
    # What the first letters of a text hold, of markup anywhere.
    (rb"(?s:<.*)?<gpx\b", "a GPX track", _TRACK),
    (rb"(?s:<.*)?<kml\b", "a KML track", _TRACK),
    (rb"<!doctype html|<html\b", "a web page", "the download gave a page in the place of the log; save the log itself"),
    (rb"<\?xml", "XML", _AS_CSV),
    (rb"\[\d{4}-\d\d-\d\d[ t]", "text with a stamp in brackets before each line", _AS_CSV),
    (rb"[{\[]", "JSON", _AS_CSV),
    (rb"date,time,.*\b(1rss|rssi|rqly|trss)\b", "telemetry that a radio logs", _SLOW),
    (rb"#dronedeploy\b", "a log of an app that plans flights", "give the log that the autopilot writes itself"),
)
_SPREADSHEET, _NPY = (b"xl/", b"[Content_Types].xml"), b".npy"
# A MAVLink frame begins with one of these; before it a telemetry log has its stamp in eight bytes, of 2001 to 2100.
_TELEMETRY: Final = (".tlog", ".rlog", ".raw", ".mavlink")
_MAVLINK, _STAMP_BYTES, _STAMPS_US = b"\xfe\xfd", 8, (10**15, 4 * 10**15)


def named_foreign(path: Path) -> str | None:
    """Say what a file is that is no log, and how to get a log from it; None for one that is not known."""
    try:
        with path.open("rb") as stream:
            first = stream.read(_FIRST_BYTES)
    except OSError:
        return None
    if not first:
        return "an empty file: nothing was logged, or the copy failed"
    found = _by_bytes(first, path.suffix.lower())
    return None if found is None else f"{found[0]}, and no log that can be read: {found[1]}"


def _by_bytes(first: bytes, suffix: str) -> tuple[str, str] | None:
    if first.startswith(b"PK\x03\x04") and (suffix in (".xlsx", ".ods") or any(own in first for own in _SPREADSHEET)):
        return "a spreadsheet", "save its table as CSV, with a line of column names"
    if first.startswith(b"PK\x03\x04") and _NPY in first:
        return "arrays of NumPy", "write them as CSV, HDF5 or .mat, with a name for each column"
    known = next((own for own in _TABLE if first.startswith(own.begins, own.at)), None)
    if known is not None:
        return known.what, known.way
    stamped = _STAMPS_US[0] < int.from_bytes(first[:_STAMP_BYTES], "big") < _STAMPS_US[1]
    frame = first[_STAMP_BYTES : _STAMP_BYTES + 1] if stamped else first[:1] if suffix in _TELEMETRY else b""
    if frame and frame in _MAVLINK:
        return "telemetry of MAVLink", _CONVERT_TLOG
    text = first.lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    return next(((what, way) for pattern, what, way in _TEXTS if re.match(pattern, text)), None)


SDLOG2: Final = f"a log of PX4 before ULog (sdlog2), and no log that can be read: {_CONVERT_SDLOG2}"
