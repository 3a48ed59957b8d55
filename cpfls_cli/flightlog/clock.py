"""The clock of a log: time stamps that increase, restarts, and the longest stretch without a long gap."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import floor, log10

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray, runs
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.settings import ImportSettings

_LARGEST_SHARE_BEHIND = 0.05  # Of all rows, up to which packets merely come late.
SMALLEST_SHARE_KEPT = 0.1  # Of a log, below which a crop that keeps it is not worth a word.
_SAME_RATE = 1e-3


@dataclass(frozen=True)
class KeptRows:
    """Rows that are kept; how many are left out as a column has no value yet or any more, and beyond a gap."""

    rows: slice
    incomplete_ends: int
    beyond_gap: int


def increasing_rows(time: Array) -> tuple[IntArray, dict[str, int]]:
    """Keep the rows whose time stamp is later than every one before; of equal stamps the first is kept.

    Parameters
    ----------
    time : array, shape (sample,), s

    Returns
    -------
    rows : array of int
        The rows that are kept.
    dropped : dict from str to int
        Rows dropped, by reason.
    """
    finite = np.isfinite(time)
    latest = np.maximum.accumulate(np.where(finite, time, -np.inf))
    before = np.concatenate([[-np.inf], latest[:-1]])
    with np.errstate(invalid="ignore"):
        dropped = {
            "time_not_finite": ~finite,
            "repeated_time": finite & (time == before),
            "backward_time": finite & (time < before),
        }
        kept = np.flatnonzero(finite & (time > before))
    return kept, {reason: int(rows.sum()) for reason, rows in dropped.items()}


def same_rate(rates_hz: Sequence[float]) -> bool:
    """Tell whether clocks are of one rate, so that one filter and one window suit them all."""
    return max(rates_hz) - min(rates_hz) <= _SAME_RATE * min(rates_hz)


def common_rate(rates_hz: Sequence[float]) -> float:
    """Give a round rate, Hz, at which logs of several rates become flights of one and none is thinned much."""
    slowest = (1 + _SAME_RATE) * min(rates_hz)
    digit = 10.0 ** (floor(log10(slowest)) - 2)
    return float(f"{floor(slowest / digit) * digit:.3g}")


def longest_stretch(time: Array, present: BoolArray, settings: ImportSettings) -> KeptRows:
    """Find the longest stretch in which no column lacks values for longer than `gap_s`, as `gap_rule` has it.

    Parameters
    ----------
    time : array, shape (sample,), s
        Increasing time stamps.
    present : array of bool, shape (sample, column)
        Where each column has a value.

    Raises
    ------
    InputError
        If a column is empty, or there is a longer gap and the rule is to stop.
    """
    if (present.sum(axis=0) < 2).any():
        raise InputError("a mapped column has fewer than two values in the part of the log that is read")
    # Between these rows every column has begun and none has ended.
    first_full = int(np.argmax(present, axis=0).max())
    last_full = len(present) - 1 - int(np.argmax(present[::-1], axis=0).max())
    if first_full >= last_full:
        raise InputError("the mapped columns of the log have no period of time in common")
    gaps = _gap_steps(time, present, settings.gap_s)[first_full:last_full]
    if gaps.any() and settings.gap_rule == "stop":
        begin, end = (time[first_full + row] for row in runs(gaps)[0])
        raise InputError(
            _slow_log(time, present, settings)
            or f"the log has a gap of {end - begin:.3g} s at {begin:.3f} s, longer than import.gap_s ="
            f" {settings.gap_s:g}: raise it, crop with import.crop_s, or set import.gap_rule to longest-part"
        )
    stretches = [(first_full + begin, first_full + end) for begin, end in runs(~gaps)]
    if not stretches:
        raise InputError(
            _slow_log(time, present, settings)
            or "no part of the log has values in all mapped columns; check import.signals and import.gap_s"
        )
    first, last = max(stretches, key=lambda run: float(time[run[1]] - time[run[0]]))
    incomplete = first_full + len(time) - 1 - last_full
    return KeptRows(slice(first, last + 1), incomplete, len(time) - incomplete - (last + 1 - first))


def _slow_log(time: Array, present: BoolArray, settings: ImportSettings) -> str | None:
    """Describe a log whose median step, not a gap in it, exceeds the longest gap allowed; None if it does not."""
    step = float(np.median(np.diff(time)))
    if step > settings.gap_s:
        return (
            f"the median step is {step:.3g} s, longer than import.gap_s = {settings.gap_s:g}: check import.time_unit ="
            f" {settings.time_unit}, or raise import.gap_s"
        )
    slowest = max(float(np.median(np.diff(time[column]))) for column in present.T)
    if slowest > settings.gap_s:
        return (
            f"a mapped column has a value only every {slowest:.3g} s (median), longer than import.gap_s ="
            f" {settings.gap_s:g}: raise import.gap_s, or leave its signal out of import.signals"
        )
    return None


def _gap_steps(time: Array, present: BoolArray, gap_s: float) -> BoolArray:
    """Mark the steps from row to row that lie inside a long gap of some column."""
    depth = np.zeros(len(time), dtype=int)
    for column in present.T:
        known = np.flatnonzero(column)
        # Stamps are rounded, so a gap of exactly the allowed length must pass.
        long = np.flatnonzero(np.diff(time[known]) > gap_s * (1 + 1e-9))
        depth[known[long]] += 1
        depth[known[long + 1]] -= 1
    inside: BoolArray = np.cumsum(depth)[:-1] > 0
    return inside


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
    behind = runs(_behind(time))
    if not _too_many(behind, len(time)):
        return
    first, length = max(((begin, end - begin) for begin, end in behind), key=lambda run: run[1])
    raise InputError(
        f"time goes backward at row {rows[first]} (from {time[first - 1]:.6g} s to {time[first]:.6g} s after the first"
        f" stamp) and stays behind for {length} rows: the clock was reset or logs were joined; {_remedy(time)}"
    )


def _remedy(time: Array) -> str:
    kept = {crop: rows for crop in _crops(time) if (rows := _rows_left(time, crop)) > SMALLEST_SHARE_KEPT * len(time)}
    if not kept:
        return "split the log (import.crop_s cannot tell the parts apart: their time stamps overlap)"
    begin, end = max(kept, key=lambda crop: kept[crop])
    return f"split the log, or keep one part of {kept[begin, end]} rows with import.crop_s = [{begin:g}, {end:g}]"


def _crops(time: Array) -> Iterator[tuple[float, float]]:
    """List the intervals of time that may hold one part of the log: before, beyond and among the stamps behind."""
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
    inside = time[(time >= crop[0]) & (time <= crop[1])]
    return 0 if _too_many(runs(_behind(inside)), len(inside)) else len(inside)


def _too_many(behind: list[tuple[int, int]], rows: int) -> bool:
    """Tell whether more rows are behind than come late one by one."""
    return sum(end - begin for begin, end in behind if end - begin > 1) > _LARGEST_SHARE_BEHIND * rows


def _behind(time: Array) -> BoolArray:
    return np.asarray(time < np.maximum.accumulate(time), dtype=bool)
