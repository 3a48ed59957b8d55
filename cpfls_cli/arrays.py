"""Array types and the shape check that all numerical packages share."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from cpfls_cli.errors import ComputationError

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
ComplexArray = npt.NDArray[np.complex128]
Numbers = npt.NDArray[Any]
"""Real, or complex for a derivative by a complex step."""


def stretches(label: npt.NDArray[Any]) -> list[tuple[int, int]]:
    """List where each stretch of one label, shape (sample,), begins, and the sample after its end."""
    changes = (np.flatnonzero(label[1:] != label[:-1]) + 1).tolist()
    return list(pairwise([0, *changes, len(label)])) if len(label) else []


def runs(marked: BoolArray) -> list[tuple[int, int]]:
    """List where each run of marked samples begins, and the sample after its end."""
    return [(first, after) for first, after in stretches(marked) if marked[first]]


def require_columns(name: str, values: Array, columns: int) -> None:
    """Refuse an array that is not of shape (time, columns).

    Parameters
    ----------
    name : str
        Name of the argument, for the message.
    values : array
        The array to check.
    columns : int
        Length of the second axis.

    Raises
    ------
    ComputationError
        If the shape differs; the message names the argument, the expected and the actual shape.
    """
    if values.ndim != 2 or values.shape[1] != columns:
        raise ComputationError(f"{name}: expected shape (time, {columns}), got {values.shape}")
