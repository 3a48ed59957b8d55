"""Array types and the shape check that all numerical packages share."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from cpfls_cli.errors import ComputationError

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
Numbers = npt.NDArray[Any]
"""Real, or complex for a derivative by a complex step."""


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
