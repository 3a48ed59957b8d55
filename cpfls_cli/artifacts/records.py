"""An artifact in memory: its format, where it comes from, its datasets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.spec import ArtifactSpec


@dataclass(frozen=True)
class InputFile:
    """A file that an artifact was made from.

    Attributes
    ----------
    name : str
        File name without its folder.
    format : str
        Artifact format, or ``csv``.
    """

    name: str
    sha256: str
    format: str


@dataclass(frozen=True)
class Header:
    """Where an artifact comes from.

    Attributes
    ----------
    version : str
        Version of the program.
    config : str
        The resolved study as YAML.
    inputs : mapping of str to InputFile
        By role.
    """

    version: str
    seed: int
    config: str
    inputs: Mapping[str, InputFile] = field(default_factory=dict)


@dataclass(frozen=True)
class Artifact:
    """One artifact in memory.

    Attributes
    ----------
    data : mapping of str to array
        By dataset path; text as arrays of str.
    """

    spec: ArtifactSpec
    header: Header
    data: Mapping[str, Any]

    def array(self, path: str) -> Array:
        """Get a dataset as an array of floats."""
        return np.asarray(self.data[path], dtype=float)

    def number(self, path: str) -> float:
        """Get a scalar dataset as a float."""
        return float(self.data[path])

    def text(self, path: str) -> str:
        """Get a scalar text dataset."""
        return str(self.data[path])

    def texts(self, path: str) -> list[str]:
        """Get a text dataset as a list."""
        return [str(item) for item in self.data[path]]
