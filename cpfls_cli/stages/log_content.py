"""Tell a log whose name says another kind of file than it holds."""

from __future__ import annotations

from pathlib import Path

from cpfls_cli.errors import InputError

_CSV = ("CSV", ".csv")
_BEGINNINGS = {
    b"PAR1": ("Parquet", ".parquet"),
    b"ULog\x01\x12\x35": ("ULog", ".ulg"),
    b"\x1f\x8b": ("gzip-compressed data", ".csv.gz"),
}
_LONGEST_LINE = 16384


def refuse_other_content(path: Path) -> None:
    """Refuse a log whose first bytes are those of another kind than its name ends in.

    Parameters
    ----------
    path : Path
        Its name ends in one of the kinds of logs.

    Raises
    ------
    InputError
        Naming what it seems to hold, and the ending that says so.
    """
    found = _kind(path)
    if found is None or path.name.lower().endswith(found[1]):
        return
    called, ending = found
    raise InputError(f"{path}: seems to hold {called}, not what its name ends in; rename it to end in {ending}")


def _kind(path: Path) -> tuple[str, str] | None:
    try:
        with path.open("rb") as stream:
            first = stream.readline(_LONGEST_LINE)
    except OSError:
        # Whoever reads it says so.
        return None
    if _is_header(first):
        return _CSV
    return next((kind for beginning, kind in _BEGINNINGS.items() if first.startswith(beginning)), None)


def _is_header(line: bytes) -> bool:
    """Tell whether a line is text with a separator of columns in it."""
    text = line.rstrip(b"\r\n")
    printable = all(byte >= 0x20 or byte == 0x09 for byte in text)
    return line.endswith(b"\n") and printable and any(separator in text for separator in b",;\t")
