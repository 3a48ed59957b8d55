"""A clock that goes back and stays behind: reset in flight, or several logs joined to one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import InputError

_LARGEST_SHARE = 0.05
_WORTH_KEEPING = 0.1


def refuse_restart(time: Array, rows: IntArray) -> None:
    """Refuse time stamps that go backward and stay behind for more than a few rows.

    A packet that comes late is behind alone and is dropped elsewhere; what counts here are rows behind in runs of two
    or more, where they make up more than 5 % of all.

    Parameters
    ----------
    time : array, shape (sample,), s
        Time stamps from the first one of the log.
    rows : array of int, shape (sample,)
        Number of each row in the log, from 1.

    Raises
    ------
    InputError
        Saying where, and what to do; a crop is offered only where it leaves one part of the log.
    """
    finite = np.isfinite(time)
    time, rows = time[finite], rows[finite]
    runs = _runs_behind(time)
    if not _too_many(runs, len(time)):
        return
    first, length = (int(number) for number in runs[np.argmax(runs[:, 1])])
    raise InputError(
        f"time goes backward at row {rows[first]} (from {time[first - 1]:.6g} s to {time[first]:.6g} s after the first"
        f" stamp) and stays behind for {length} rows: the clock was reset or logs were joined; {_remedy(time)}"
    )


def _remedy(time: Array) -> str:
    kept = {crop: rows for crop in _crops(time) if (rows := _rows_left(time, crop)) > _WORTH_KEEPING * len(time)}
    if not kept:
        return "split the log (import.crop_s cannot tell the parts apart: their time stamps overlap)"
    begin, end = max(kept, key=lambda crop: kept[crop])
    return f"split the log, or keep one part of {kept[begin, end]} rows with import.crop_s = [{begin:g}, {end:g}]"


def _crops(time: Array) -> Iterator[tuple[float, float]]:
    """List the stretches of stamps that may belong to one part: before, beyond and among the stamps behind."""
    behind = _behind(time)
    last = float(time.max())
    lowest, highest = float(time[behind].min()), float(time[behind].max())
    earlier, later = time[~behind & (time < lowest)], time[~behind & (time > highest)]
    stretches = [(0.0, max(0.0, highest)), (max(0.0, lowest), highest)]
    stretches += [(0.0, float(earlier.max()))] if len(earlier) else []
    stretches += [(max(0.0, float(later.min())), last)] if len(later) else []
    yield from {(float(f"{begin:g}"), float(f"{end:g}")) for begin, end in stretches if begin < end}


def _rows_left(time: Array, crop: tuple[float, float]) -> int:
    """Count the rows that a crop leaves; 0 where the clock goes back within it."""
    left = time[(time >= crop[0]) & (time <= crop[1])]
    return 0 if _too_many(_runs_behind(left), len(left)) else len(left)


def _too_many(runs: IntArray, rows: int) -> bool:
    return bool(runs[runs[:, 1] > 1, 1].sum() > _LARGEST_SHARE * rows)


def _runs_behind(time: Array) -> IntArray:
    """List the first row and the length of each run of rows behind, shape (run, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], _behind(time), [False]]).astype(int))).reshape(-1, 2)
    return np.column_stack([edges[:, 0], edges[:, 1] - edges[:, 0]])


def _behind(time: Array) -> BoolArray:
    return np.asarray(time < np.maximum.accumulate(time), dtype=bool)
