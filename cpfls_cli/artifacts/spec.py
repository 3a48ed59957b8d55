"""What files of results have in common: names, frames, and the files that one was made from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

SCHEMA_VERSION = 3
"""Raised when a dataset is renamed, removed or changes its meaning; new optional datasets do not raise it."""

CONFIG = "config"
"""Path of the resolved study, in every artifact."""

INPUTS = "inputs"
"""Path of the group with one group for each input file, by role."""

EULER = "Euler angles (intrinsic ZYX)"
BODY = "body (FLU)"
WORLD = "world (z up)"

PART = 8192
"""Samples of a compressed artifact that are written at a time, each such part compressed on its own."""


class DatasetSpec(NamedTuple):
    """One dataset of a file.

    Attributes
    ----------
    path : str
        HDF5 path below the root.
    dimensions : tuple of str
        Labels of the axes; time or samples first. Digits fix the length, ``axis`` is 3.
    units : str
        SI units; ``1`` for a pure number, ``text`` for text.
    frame : str
        Frame of reference of its components.
    description : str
        What it holds.
    """

    path: str
    dimensions: tuple[str, ...]
    units: str
    frame: str
    description: str


@dataclass(frozen=True)
class InputFile:
    """A file that an artifact was made from.

    Attributes
    ----------
    name : str
        File name without its folder.
    sha256 : str
        Hexadecimal.
    format : str
        Artifact format, or the suffix of another file.
    """

    name: str
    sha256: str
    format: str
