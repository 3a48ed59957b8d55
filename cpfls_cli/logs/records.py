"""Binary records of several kinds, mixed in one file, as tables of numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.arrays import Array


def table(content: bytes, begins: Sequence[int], kind: np.dtype) -> np.ndarray:
    """Gather the records of one kind.

    Parameters
    ----------
    content : bytes
        Of the file.
    begins : sequence of int
        Where each record begins.
    kind : dtype
        Fields of a record, packed.

    Returns
    -------
    structured array, shape (record,)
    """
    bytes_of = np.frombuffer(content, dtype=np.uint8)
    places = np.asarray(begins, dtype=np.int64)[:, None] + np.arange(kind.itemsize)
    return np.ascontiguousarray(bytes_of[places]).view(kind)[:, 0]


def numbers(values: np.ndarray) -> Array:
    """Convert numbers of any type; what a broken log takes for one may be no number."""
    with np.errstate(invalid="ignore"):
        return np.asarray(values, dtype=float)


def seconds(stamps: np.ndarray, origin: int, per_second: int) -> Array:
    """Convert whole numbers to s from an origin; their difference is exact."""
    return np.asarray((stamps.astype(np.int64) - origin) / per_second, dtype=float)
