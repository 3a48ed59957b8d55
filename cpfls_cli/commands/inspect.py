"""Stages `info` and `check`: what an artifact holds, and whether it keeps to its format."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.check import check_artifact
from cpfls_cli.artifacts.store import Artifact, read_artifact
from cpfls_cli.report.outcome import Outcome

_SHORT = 8


def info(path: Path) -> Outcome:
    """Describe an artifact: where it comes from and what it holds."""
    artifact = read_artifact(path)
    header = artifact.header
    datasets = {name: _describe(artifact, name) for name in artifact.data}
    summary = {
        "file": str(path),
        "format": artifact.spec.format,
        "cpfls_version": header.version,
        "seed": header.seed,
        "inputs": {role: vars(source) for role, source in header.inputs.items()},
        "datasets": datasets,
    }
    lines = [f"{artifact.spec.format}: {artifact.spec.description}", f"cpfls {header.version}, seed {header.seed}"]
    lines += [f"from {role}: {source.name} (sha256 {source.sha256[:12]})" for role, source in header.inputs.items()]
    width = max(len(name) for name in datasets)
    for name, entry in datasets.items():
        shown = entry.get("value", "x".join(str(n) for n in entry["shape"]))
        lines.append(f"{name:{width}}  {shown}  [{entry['units']}]  {entry['description']}")
    return Outcome(summary, tuple(lines))


def check(path: Path) -> tuple[Outcome, bool]:
    """Check an artifact against its format."""
    artifact = read_artifact(path)
    found = check_artifact(artifact)
    summary = {"file": str(path), "format": artifact.spec.format, "good": not found, "findings": found}
    lines = tuple(f"{path}: {finding}" for finding in found) or (f"{path}: good ({artifact.spec.format})",)
    return Outcome(summary, lines), not found


def _describe(artifact: Artifact, name: str) -> dict[str, Any]:
    spec = artifact.spec.dataset(name)
    values = np.asarray(artifact.data[name])
    entry: dict[str, Any] = {"shape": list(values.shape), "units": "", "description": ""}
    if spec is not None:
        entry |= {"units": spec.units, "frame": spec.frame, "description": spec.description}
    if values.ndim == 0 or (values.dtype.kind == "U" and values.size <= _SHORT):
        entry["value"] = values.tolist()
    return entry
