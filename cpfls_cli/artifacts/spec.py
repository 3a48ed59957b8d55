"""What an artifact is made of: the words that describe a dataset and a format."""

from __future__ import annotations

from dataclasses import dataclass, field

SCHEMA_VERSION = 1
"""Raised when a dataset is renamed, removed or changes its meaning; new optional datasets do not raise it."""

CONFIG = "config"
"""Path of the resolved study, in every artifact."""

INPUTS = "inputs"
"""Path of the group with one group for each input file, by role."""

EULER = "Euler angles (intrinsic ZYX)"
BODY = "body (FLU)"
WORLD = "world (z up)"
NO_FRAME = "none"


@dataclass(frozen=True)
class DatasetSpec:
    """One dataset of an artifact.

    Attributes
    ----------
    path : str
        HDF5 path below the root.
    dimensions : tuple of str
        Labels of the axes; time or samples first. Digits fix the length, ``axis`` is 3.
    units : str
        SI units; ``1`` for a pure number, ``text`` for text.
    required : bool
        Whether every artifact of the format holds it.
    gaps : bool
        Whether values may be not finite, and mean "not known" there.
    """

    path: str
    dimensions: tuple[str, ...]
    units: str
    frame: str
    description: str
    required: bool = True
    gaps: bool = False


@dataclass(frozen=True)
class ArtifactSpec:
    """One artifact format.

    Attributes
    ----------
    format : str
        Value of the root attribute ``format``.
    made_by : str
        The command that writes it.
    inputs : tuple of str
        Roles of the files it was made from.
    """

    format: str
    description: str
    made_by: str
    datasets: tuple[DatasetSpec, ...]
    inputs: tuple[str, ...] = field(default=())

    @property
    def makers(self) -> str:
        """Name the commands that write it, as they are typed."""
        return " or ".join(f"`cpfls {command.strip()}`" for command in self.made_by.split(","))

    def dataset(self, path: str) -> DatasetSpec | None:
        """Look up a dataset by its path."""
        return next((spec for spec in self.datasets if spec.path == path), None)
