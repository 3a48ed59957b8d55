"""The clock of a log: which time stamps count, and which stretch has no gap that is too long."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.settings import ImportSettings


@dataclass(frozen=True)
class Stretch:
    """Rows of a log between two rows, both included.

    Attributes
    ----------
    rows : slice
        The rows that are kept.
    incomplete_ends, beyond_gap : int
        Rows left out because a column has no value yet or any more, and because they lie beyond a gap.
    """

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


def longest_stretch(time: Array, present: BoolArray, settings: ImportSettings) -> Stretch:
    """Find the rows between which no column lacks values for longer than the longest gap allowed.

    Parameters
    ----------
    time : array, shape (sample,), s
        Increasing time stamps.
    present : array of bool, shape (sample, column)
        Where each column has a value.
    settings : ImportSettings
        `gap_s` and `gap_rule`.

    Returns
    -------
    Stretch
        The longest such stretch.

    Raises
    ------
    InputError
        If a column is empty, or there is a longer gap and the rule is to stop.
    """
    first_full, last_full = _common_span(present)
    gaps = _gap_steps(time, present, settings.gap_s)[first_full:last_full]
    if gaps.any() and settings.gap_rule == "stop":
        begin, end = (time[first_full + row] for row in _runs(gaps)[0])
        raise InputError(
            _slow_log(time, present, settings)
            or f"the log has a gap of {end - begin:.3g} s at {begin:.3f} s, longer than import.gap_s ="
            f" {settings.gap_s:g}: raise it, cut with import.crop_s, or set import.gap_rule to longest-part"
        )
    stretches = [(first_full + begin, first_full + end) for begin, end in _runs(~gaps)]
    if not stretches:
        raise InputError(
            _slow_log(time, present, settings)
            or "no stretch of the log has values in all mapped columns; see import.signals, import.gap_s"
        )
    first, last = max(stretches, key=lambda run: float(time[run[1]] - time[run[0]]))
    incomplete = first_full + len(time) - 1 - last_full
    return Stretch(slice(first, last + 1), incomplete, len(time) - incomplete - (last + 1 - first))


def _slow_log(time: Array, present: BoolArray, settings: ImportSettings) -> str | None:
    """Say so where the usual step, not a gap in it, is longer than the longest gap allowed."""
    step = float(np.median(np.diff(time)))
    if step > settings.gap_s:
        return (
            f"the median step is {step:.3g} s, longer than import.gap_s = {settings.gap_s:g}: is import.time_unit ="
            f" {settings.time_unit} right, or raise import.gap_s"
        )
    slowest = max(float(np.median(np.diff(time[column]))) for column in present.T)
    if slowest > settings.gap_s:
        return (
            f"a mapped column has a value only every {slowest:.3g} s (median), longer than import.gap_s ="
            f" {settings.gap_s:g}: raise import.gap_s, or leave its signal out of import.signals"
        )
    return None


def _common_span(present: BoolArray) -> tuple[int, int]:
    """Find the first and the last row between which every column has begun and none has ended."""
    if (present.sum(axis=0) < 2).any():
        raise InputError("a mapped column has fewer than two values in the part of the log that is read")
    first = int(np.argmax(present, axis=0).max())
    last = len(present) - 1 - int(np.argmax(present[::-1], axis=0).max())
    if first >= last:
        raise InputError("the mapped columns of the log have no stretch of time in common")
    return first, last


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


def _runs(steps: BoolArray) -> list[tuple[int, int]]:
    """List the first and the last row of each run of marked steps."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], steps, [False]]).astype(int)))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]
