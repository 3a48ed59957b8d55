"""A reason: one sentence, and what it speaks for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.identification.findings import AXES

FOR, NEITHER, AGAINST = 1, 0, -1


class Reason(NamedTuple):
    """A reason.

    Attributes
    ----------
    text : str
        One sentence with its number.
    speaks : int
        1 for the model, -1 against it, 0 neither.
    """

    text: str
    speaks: int


def numbers(values: Array, shown: BoolArray | None = None) -> str:
    """Print the numbers of the three axes.

    Parameters
    ----------
    values : array, shape (3,)
    shown : array of bool, shape (3,), optional
        Axes to print; all by default.

    Returns
    -------
    str
        As ``roll 0.95 pitch 0.97 yaw 0.23``.
    """
    axes = np.flatnonzero(np.ones(3, dtype=bool) if shown is None else shown)
    return " ".join(f"{AXES[axis]} {values[axis]:.3g}" for axis in axes)
