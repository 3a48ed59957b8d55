"""Commands that print what an artifact holds, and whether it keeps to its format: `info` and `check`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.spec import Record
from cpfls_cli.artifacts.store import Outline, findings_of, read_any, read_outline
from cpfls_cli.errors import InputError
from cpfls_cli.flights.models import any_model, is_model
from cpfls_cli.pages.trust import stopped_words, trust_facts
from cpfls_cli.report.content import Block, Facts, Folded, Table, Text
from cpfls_cli.report.outcome import Outcome
from cpfls_cli.store import findings_in, stage_of

_FINDINGS_SHOWN = 8
_CAUTION = "caution"
_PAGES = {
    "cpfls/model": "model",
}
"""Modules of `pages` that word an answer, by format; a flight, whose answer needs all of it, may not fit in memory."""


def info(path: Path) -> Outcome:
    """Describe an artifact: where it comes from and what it holds."""
    if name := stage_of(path):
        made: Outcome = import_module("cpfls_cli.stage").loaded(name).info(path)
        return made
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
    followed = (("cpfls", "check", path),)
    if artifact.spec.name not in _PAGES:
        return Outcome(summary, description(artifact), next=followed)
    record = read_any(path)
    if not isinstance(record, ModelRecord):
        return Outcome(summary, tuple(_answered(artifact, record, path)), next=followed)
    return Outcome(summary | record.provenance, tuple(_answered(artifact, record, path, trust_facts(record))))


def _answered(artifact: Outline, record: Record, path: Path, more: Sequence[tuple[str, str]] = ()) -> Iterator[Block]:
    """Tell what an artifact is and what its command answered; where it comes from and what it holds is folded."""
    what, origin, holds = description(artifact, more)
    yield what
    cautions = [row for row in origin.rows if row[0] == _CAUTION]
    yield from [Facts(cautions)] if cautions else []
    source = import_module("cpfls_cli.pages.source")
    yield from source.answer_again(_PAGES[artifact.spec.name], record, path)
    yield Folded("where it comes from", [Facts([row for row in origin.rows if row[0] != _CAUTION])])
    yield holds


def artifact_that_tells(output: Path) -> Path | None:
    """Find the artifact among what a command wrote whose `info` tells its answer again; None where there is none."""
    paths = [output / "diagnosis.h5", output / "changed.h5", output / "trend.h5"] if output.is_dir() else [output]
    for path in paths:
        if stage_of(path):
            return path
        with suppress(InputError):
            if read_outline(path).spec.name in _PAGES:
                return path
    return None


def description(artifact: Outline, more: Sequence[tuple[str, str]] = ()) -> tuple[Block, Facts, Block]:
    """Tell what an artifact is, where it comes from with more facts on it, and what it holds, dataset by dataset."""
    header = artifact.header
    origin = [("made by", f"cpfls {header.version}, seed {header.seed}")]
    origin += [(role, f"{source.name} (sha256 {source.sha256[:12]})") for role, source in header.inputs.items()]
    rows = [_dataset_row(name, _describe_dataset(artifact, name)) for name in artifact.shapes]
    columns = ("Dataset", "Shape", "Unit", "What it holds")
    table = Table("datasets", "", columns, rows, frozenset(range(len(columns))), frozenset({3}))
    origin += [(_CAUTION, each) for each in header.cautions]
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
    if stage := stage_of(path):
        made = import_module("cpfls_cli.stage").loaded(stage).kind
        name, findings = made.FORMAT, findings_in(path, made)
    else:
        spec, findings = findings_of(path)
        name = spec.name
    summary = {"file": str(path), "format": name, "good": not findings, "findings": findings}
    stopped = "" if findings or not is_model(path) else stopped_words(any_model(path))
    good = f"keeps to its format ({name}), but its search was {stopped}" if stopped else f"good ({name})"
    summary |= {"stopped": stopped} if stopped else {}
    said = [Text(f"{path}: {finding}") for finding in findings] or [Text(f"{path}: {good}")]
    rest = said[_FINDINGS_SHOWN:]
    more = [Folded(f"{len(rest)} more findings", rest)] if rest else []
    followed = () if findings else (("cpfls", "info", path),)
    return Outcome(summary, (*said[:_FINDINGS_SHOWN], *more), int(bool(findings)), followed)
