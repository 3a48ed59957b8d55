"""Lists of records as datasets, one for each field, and back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cpfls_cli.artifacts.store import Artifact


def texts(values: Iterable[str]) -> Any:
    """Make a text dataset; an empty one is text too."""
    listed = list(values)
    return np.array(listed) if listed else np.array([], dtype="U1")


def table(
    group: str, rows: Sequence[Mapping[str, Any]], words: Sequence[str], numbers: Sequence[str]
) -> dict[str, Any]:
    """Arrange records as datasets.

    Parameters
    ----------
    words, numbers : sequence of str
        Fields that hold text, and fields that hold numbers.
    """
    return {
        **{f"{group}/{field}": texts(row[field] for row in rows) for field in words},
        **{f"{group}/{field}": np.array([row[field] for row in rows], dtype=float) for field in numbers},
    }


def rows_of(artifact: Artifact, group: str, words: Sequence[str], numbers: Sequence[str]) -> list[dict[str, Any]]:
    """Rebuild the records of datasets."""
    columns: dict[str, list[Any]] = {field: artifact.texts(f"{group}/{field}") for field in words}
    columns |= {field: artifact.array(f"{group}/{field}").tolist() for field in numbers}
    return [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
