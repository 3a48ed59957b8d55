"""Cells of attitude that data visit."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.rotations import wrapped

CELLS = 72
"""Cells per turn, 5 degrees each."""


def visited_cells(attitudes: Iterable[Array]) -> BoolArray:
    """Mark the cells of roll and pitch that data visit, and their neighbours.

    Parameters
    ----------
    attitudes : iterable of array, shape (samples, 3), rad
        Chunk by chunk.

    Returns
    -------
    array of bool, shape (72, 72)
        Roll along the first axis, from -180 degrees.
    """
    visited = np.zeros((CELLS, CELLS), dtype=bool)
    for attitude in attitudes:
        visited[_cells(attitude[:, 0]), _cells(attitude[:, 1])] = True
    shifts = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    return np.asarray(np.any([np.roll(visited, shift, axis=(0, 1)) for shift in shifts], axis=0))


def outside_visited(visited: BoolArray, attitude: Array) -> BoolArray:
    """Flag attitudes whose cell was not visited.

    Parameters
    ----------
    visited : array of bool, shape (72, 72)
    attitude : array, shape (samples, 3), rad
    """
    return np.asarray(~visited[_cells(attitude[:, 0]), _cells(attitude[:, 1])])


def _cells(angle: Array) -> IntArray:
    cells: IntArray = np.floor((wrapped(angle) + np.pi) * (CELLS / (2 * np.pi))).astype(np.int64)
    return np.clip(cells, 0, CELLS - 1)
