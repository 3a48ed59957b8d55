"""Check an artifact against its format: one small rule after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

import numpy as np

from cpfls_cli.artifacts.spec import ArtifactSpec, DatasetSpec

_FIXED = {"axis": 3}


class Checkable(Protocol):
    """An artifact as its format and its datasets by path."""

    @property
    def spec(self) -> ArtifactSpec:
        """Its format."""
        ...

    @property
    def data(self) -> Mapping[str, Any]:
        """Its datasets by path."""
        ...


def check_artifact(artifact: Checkable) -> list[str]:
    """Find everything in an artifact that its format does not allow.

    Returns
    -------
    list of str
        One sentence per finding; empty for a good artifact.
    """
    return [finding for rule in _RULES for finding in rule(artifact)]


def _dimensions(artifact: Checkable) -> Iterator[str]:
    lengths: dict[str, tuple[int, str]] = {}
    for spec, values in _present(artifact):
        if values.ndim != len(spec.dimensions):
            yield f"{spec.path}: has {values.ndim} dimensions, expected {len(spec.dimensions)} {spec.dimensions}"
            continue
        for label, length in zip(spec.dimensions, values.shape, strict=True):
            fixed = int(label) if label.isdigit() else _FIXED.get(label)
            known, where = (fixed, "the format") if fixed else lengths.setdefault(label, (length, spec.path))
            if length != known:
                yield f"{spec.path}: {length} along '{label}', but {known} by {where}"


def _kinds(artifact: Checkable) -> Iterator[str]:
    for spec, values in _present(artifact):
        wanted = "text" if spec.units == "text" else "numbers"
        if (values.dtype.kind == "U") != (wanted == "text") or values.dtype.kind not in "Uiuf":
            yield f"{spec.path}: holds {values.dtype}, expected {wanted}"


def _finite(artifact: Checkable) -> Iterator[str]:
    for spec, values in _present(artifact):
        if values.dtype.kind == "f" and not spec.gaps:
            bad = np.flatnonzero(~np.isfinite(values).all(axis=tuple(range(1, values.ndim))))
            if bad.size:
                yield f"{spec.path}: {bad.size} samples are not finite, the first at index {bad[0]}"


def _time_ascends(artifact: Checkable) -> Iterator[str]:
    time = np.asarray(artifact.data.get("time", ()))
    if time.ndim == 1 and time.dtype.kind in "iuf" and np.any(np.diff(time) <= 0):
        yield f"time: does not ascend at index {int(np.argmax(np.diff(time) <= 0)) + 1}"


def _present(artifact: Checkable) -> Iterator[tuple[DatasetSpec, np.ndarray]]:
    for spec in artifact.spec.datasets:
        if spec.path in artifact.data:
            yield spec, np.asarray(artifact.data[spec.path])


_RULES: tuple[Callable[[Checkable], Iterator[str]], ...] = (_dimensions, _kinds, _finite, _time_ascends)
