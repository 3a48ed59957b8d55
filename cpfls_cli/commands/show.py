"""Commands that print what an artifact holds, and whether it keeps to its format: `info` and `check`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.store import Outline, findings_of, read_outline, read_record
from cpfls_cli.pages.trust import trust_facts
from cpfls_cli.report.content import Block, Facts, Folded, Table, Text
from cpfls_cli.report.outcome import Outcome

_FINDINGS_SHOWN = 8


def info(path: Path) -> Outcome:
    """Describe an artifact: where it comes from and what it holds."""
    artifact = read_outline(path)
    header = artifact.header
    datasets = {name: _describe_dataset(artifact, name) for name in artifact.shapes}
    summary = {
        "file": str(path),
        "format": artifact.spec.name,
        "cpfls_version": header.version,
        "seed": header.seed,
        "inputs": {role: vars(source) for role, source in header.inputs.items()},
        "cautions": list(header.cautions),
        "datasets": datasets,
    }
    if artifact.spec.name != ModelRecord.FORMAT.name:
        return Outcome(summary, description(artifact), next=(("cpfls", "check", path),))
    model = read_record(path, ModelRecord)
    gusts = model.vehicle.gusts
    told = model.provenance | ({} if gusts is None else {"gusts": gusts.summary})
    return Outcome(summary | told, description(artifact, trust_facts(model)))


def description(artifact: Outline, more: Sequence[tuple[str, str]] = ()) -> tuple[Block, ...]:
    """Tell where an artifact comes from, more facts on it, and what it holds, dataset by dataset."""
    header = artifact.header
    origin = [("made by", f"cpfls {header.version}, seed {header.seed}")]
    origin += [(role, f"{source.name} (sha256 {source.sha256[:12]})") for role, source in header.inputs.items()]
    rows = [_dataset_row(name, _describe_dataset(artifact, name)) for name in artifact.shapes]
    columns = ("Dataset", "Shape", "Unit", "What it holds")
    table = Table("datasets", "", columns, rows, frozenset(range(len(columns))), frozenset({3}))
    origin += [("caution", each) for each in header.cautions]
    holds = Folded(f"what its {len(rows)} datasets hold", [table])
    return Text(f"{artifact.spec.name}: {artifact.spec.description}"), Facts([*origin, *more]), holds


def _describe_dataset(artifact: Outline, name: str) -> dict[str, Any]:
    spec = artifact.spec.dataset(name)
    assert spec is not None, "the format names it"
    entry = {
        "shape": list(artifact.shapes[name]),
        "units": spec.units,
        "description": spec.description,
        "frame": spec.frame,
    }
    return entry | ({"value": np.asarray(artifact.values[name]).tolist()} if name in artifact.values else {})


def _dataset_row(name: str, entry: dict[str, Any]) -> list[str]:
    shape = "x".join(str(length) for length in entry["shape"]) or "scalar"
    value = entry.get("value", [])
    shown = ", ".join(filter(None, value)) if isinstance(value, list) else str(value)
    return [name, shape, entry["units"], f"{entry['description']}{': ' if shown else ''}{shown}"]


def check(path: Path) -> Outcome:
    """Check an artifact against its format; the exit code is 1 where it does not keep to it."""
    spec, findings = findings_of(path)
    summary = {"file": str(path), "format": spec.name, "good": not findings, "findings": findings}
    said = [Text(f"{path}: {finding}") for finding in findings] or [Text(f"{path}: good ({spec.name})")]
    rest = said[_FINDINGS_SHOWN:]
    more = [Folded(f"{len(rest)} more findings", rest)] if rest else []
    followed = () if findings else (("cpfls", "info", path),)
    return Outcome(summary, (*said[:_FINDINGS_SHOWN], *more), int(bool(findings)), followed)
