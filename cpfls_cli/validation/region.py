"""The region of attitudes that training visited, in words."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import BoolArray


def region_in_words(visited: BoolArray) -> str:
    """Describe the attitudes that training visited.

    Parameters
    ----------
    visited : array of bool, shape (cells, cells)
        Cells of roll and pitch, roll along the first axis, from -180 degrees.

    Returns
    -------
    str
        The shortest ranges of roll and pitch that hold all cells visited, and the share of all cells.
    """
    roll, pitch = (_range(np.asarray(visited.any(axis=other))) for other in (1, 0))
    return f"roll {roll}, pitch {pitch} ({100 * np.mean(visited):.3g} % of all roll and pitch)"


def _range(marked: BoolArray) -> str:
    """Describe the shortest arc that holds all marked cells of a circle."""
    cells, places = len(marked), np.flatnonzero(marked)
    if len(places) == cells:
        return "all round"
    if len(places) == 0:
        return "nowhere"
    # The arc ends where the longest pause begins, and starts behind it.
    pauses = np.diff(np.append(places, places[0] + cells))
    longest = int(np.argmax(pauses))
    start = int(places[(longest + 1) % len(places)])
    end = start + cells - int(pauses[longest]) + 1
    return f"{_degrees(start, cells)} to {_degrees(end, cells)} degrees"


def _degrees(edge: int, cells: int) -> str:
    return f"{360 * edge / cells - 180:g}"
