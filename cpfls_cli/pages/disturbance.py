"""Gusts in the flights that a model was found in or held against: in words, and as a table."""

from __future__ import annotations

import numpy as np

from cpfls_cli.playback.gusts import GustAxis
from cpfls_cli.report.content import number
from cpfls_cli.words import joined

STILL_AIR = "flown in still air; the model holds the gusts of its flights: --gusts plays them"
"""Of a flight in which the gusts that its model holds were not played."""


def gust_words(axes: list[GustAxis], instrument_kind: str) -> str:
    """Tell sizes and memories by axis, and what no gust exceeds."""
    known = [axis_words(axis) for axis in axes if np.isfinite(axis.size)]
    least = [
        f"{number(axis.high, 2)} {_unit(axis)} {_where(axis)}"
        for axis in axes
        if np.isfinite(axis.high) and not np.isfinite(axis.size)
    ]
    open_ = [_where(axis) for axis in axes if not np.isfinite(axis.high)]
    said = [f"Gusts: {'; '.join(known)}."] if known else []
    if least:
        said.append(f"No gusts above {joined(least)}{_UNIDENTIFIED if instrument_kind == 'none' else ''}.")
    if open_:
        said.append(f"Gusts {joined(open_)} are not known, because what they move is not.")
    if known:
        what = "the innovations" if instrument_kind == "past" else "what is not repeatable"
        said.append(f"Standard deviations of {what}; `cpfls simulate --model --gusts` plays them.")
    return " ".join(said)


_UNIDENTIFIED = ": all that the model leaves, because nothing separates gusts from what it lacks"


def axis_words(axis: GustAxis) -> str:
    """Write size and memory of gusts about or along an axis, with their intervals."""
    size = f"{number(axis.size, 2)} {_unit(axis)} {_where(axis)} ({_ends(axis.low, axis.high)})"
    return f"{size}, lasting {number(axis.memory, 2)} s ({_ends(axis.memory_low, axis.memory_high)})"


def _ends(low: float, high: float) -> str:
    return f"{number(low, 2)} to {number(high, 2)}"


def _unit(axis: GustAxis) -> str:
    return "rad/s²" if axis.turns else "m/s²"


def _where(axis: GustAxis) -> str:
    return f"about {axis.name}" if axis.turns else f"along {axis.name}"
