"""Binary records of several kinds, mixed in one file, as tables of numbers."""

import re
import time
from collections.abc import Sequence
from math import nan
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.errors import InputError

# Of 2005 and 2100: nothing flew a multirotor that logs before, or has yet after.
_FIRST_DATE, _DAY_S = 1.1e9, 86400.0


def bytes_of(path: Path) -> bytes:
    """Read a file as a whole."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error}") from None


def table(content: bytes, begins: Sequence[int], kind: np.dtype) -> np.ndarray:
    """Gather the records of one kind, whose fields are packed, from where each begins: shape (record,)."""
    single = np.frombuffer(content, dtype=np.uint8)
    places = np.asarray(begins, dtype=np.int64)[:, None] + np.arange(kind.itemsize)
    return np.ascontiguousarray(single[places]).view(kind)[:, 0]


def numbers(values: np.ndarray) -> Array:
    """Convert numbers of any type; what a broken log takes for one may be no number."""
    with np.errstate(invalid="ignore"):
        return np.asarray(values, dtype=float)


def plain(text: str) -> str:
    """Give a message to the pilot without the escapes that colour it and without control characters."""
    return re.sub(r"[\x00-\x1f\x7f-\x9f]+", " ", re.sub(r"\x1b\[[0-9;]*m", "", text)).strip()


def date(second: float) -> float:
    """Give s since 1970 began, or NaN for what is no date: a clock that was never set is in 1970, 1980 or to come."""
    return float(second) if _FIRST_DATE < second < time.time() + _DAY_S else nan


def seconds(stamps: np.ndarray, origin: int, per_second: int) -> Array:
    """Convert whole numbers to s from an origin; their difference is exact, also of stamps beyond half of 64 bits."""
    since = stamps.astype(np.int64).astype(np.uint64) - np.uint64(origin % 2**64)
    return np.asarray(since.astype(np.int64) / per_second, dtype=float)


def undone_turns(stamps: Array, resets: Array, turns: Array, aloft: Array) -> Array:
    """Compute by how much to turn each stamp's yaw so that no reset of an estimator shows, rad.

    Into the axes that hold for most of the stamps aloft: an estimator resets a yaw that it knows better by then, and
    what it says on the ground is of other iron. Positions and velocities by satellites are in true axes throughout.
    """
    left = np.append(np.cumsum(turns[::-1])[::-1], 0.0)
    held = np.bincount(np.searchsorted(resets, aloft, side="right"))
    return np.asarray(left[np.searchsorted(resets, stamps, side="right")] - left[held.argmax()], dtype=float)


def stamps_while(stamps: Array, changes: Array, on: BoolArray) -> Array:
    """Keep the stamps at which what changes at times is on, or all if it never is; at first it is not."""
    state = np.append(False, on)[np.searchsorted(changes, stamps, side="right")]
    return np.asarray(stamps[state] if state.any() else stamps, dtype=float)
