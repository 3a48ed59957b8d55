"""Signals over time as a page shows them: thinned so that no peak is lost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cpfls_cli.arrays import Array
from cpfls_cli.result import about, result

MOST_SAMPLES = 100_000
"""Of a track; a screen is some thousand points wide."""
_PAUSE = 8.0
"""Usual steps between samples from which a longer one is a gap."""


@result
class Track:
    """Signals on one clock, with NaN where there is none."""

    labels: tuple[str, ...] = about("name of each signal", "channel")
    time: Array = about("from the first stamp of the log", "sample", unit="s", brief=False)
    values: NDArray[np.float32] = about("of each signal", "sample", "channel", unit="SI", gaps=True, brief=False)
    dashed: bool = about("whether it is what was asked for, drawn over what was flown", default=False)


def track(
    labels: tuple[str, ...], time: Array, values: Array, *, dashed: bool = False, most: int = MOST_SAMPLES
) -> Track:
    """Take signals, shape (sample,) or (sample, channel), of increasing time; those without a value are left out."""
    with np.errstate(over="ignore"):
        held = np.asarray(values, np.float32).reshape(len(time), len(labels))
    known = np.atleast_1d(np.isfinite(held).any(axis=0))
    held = held[:, known]
    steps = np.diff(time)
    behind = np.flatnonzero(steps > _PAUSE * np.median(steps)) + 1 if len(steps) else np.empty(0, int)
    # Between the last sample before a gap and the first behind it no line leads.
    whole_time = np.insert(np.asarray(time, float), behind, 0.5 * (time[behind - 1] + time[behind]))
    kept_time, kept = thinned(whole_time, np.insert(held, behind, np.nan, axis=0), most)
    named = tuple(label for label, one in zip(labels, known, strict=True) if one)
    return Track(labels=named, dashed=dashed, time=kept_time, values=kept)


def thinned(time: Array, values: NDArray[np.float32], most: int) -> tuple[Array, NDArray[np.float32]]:
    """Keep lowest and highest of each stretch of signals, in the order in which they come; a gap stays one.

    Parameters
    ----------
    values : array, shape (sample, channel)
    most : int
        Samples to keep, at most.
    """
    size = -(-len(time) // (most // 2))
    if size <= 2:
        return time, values
    stretches = -(-len(time) // size)
    # The last stretch is filled up with its last sample.
    padded = np.concatenate([values, np.repeat(values[-1:], stretches * size - len(values), axis=0)])
    blocks = padded.reshape(stretches, size, -1)
    gap = np.isnan(blocks).any(axis=1)
    low, high = np.nan_to_num(blocks, nan=np.inf).argmin(axis=1), np.nan_to_num(blocks, nan=-np.inf).argmax(axis=1)
    pair = np.sort(np.stack([low, high], axis=1), axis=1)
    kept = np.take_along_axis(blocks, pair, axis=1)
    # A stretch with a gap in it begins with the gap.
    kept[:, 0][gap] = np.nan
    at = np.minimum(size * np.arange(stretches)[:, None] + [0, size // 2], len(time) - 1)
    return time[at].ravel(), kept.reshape(2 * stretches, -1)
