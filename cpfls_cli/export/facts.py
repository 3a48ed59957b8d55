"""What a reader of source code should know of the model in it, as paragraphs of a comment."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.export.sheet import Evidence, Provenance, Sheet

_SIGNS = {1.0: "for", -1.0: "against"}


def banner(sheet: Sheet) -> list[str]:
    """Say first what must not be overlooked.

    Returns
    -------
    list of str
        Empty for a complete model.
    """
    if sheet.evidence.complete:
        return []
    why = f" ({sheet.evidence.stop_reason})" if sheet.evidence.stop_reason else ""
    return ["", f"INCOMPLETE MODEL: its search did not come to its end{why}. Do not fly with it."]


def facts(sheet: Sheet) -> list[str]:
    """Say what the model is, what it is worth and where it comes from."""
    return [_structure(sheet), "", *_worth(sheet.evidence), "", *_origin(sheet.provenance)]


def _structure(sheet: Sheet) -> str:
    settings, structure = sheet.model.structure.settings, sheet.model.structure
    order = f" of order {settings.harmonic_order}" if settings.consequents == "harmonic" else ""
    functions = ", ".join(f"{partition.name} {partition.functions}" for partition in structure.partitions)
    share = np.mean(sheet.model.visited)
    fuzzy = "" if sheet.fuzzy else " The fuzzy part is off: this is a rigid body."
    return (
        f"Structure: {settings.structure}, {settings.input_map} inputs, {settings.consequents} consequents{order}, "
        f"{settings.products} products; membership functions {functions}; {structure.parameters} coefficients; "
        f"base {sheet.base}.{fuzzy} Training visited {share:.1%} of the circle of roll and pitch."
    )


def _worth(evidence: Evidence) -> Iterator[str]:
    if evidence.verdict is None:
        yield "Verdict: none; the model holds no validation."
    else:
        yield f"Verdict: {evidence.verdict.label}. {evidence.verdict.region}"
        for reason, speaks in evidence.verdict.reasons:
            yield f"- {_SIGNS.get(speaks, 'note')}: {reason}"
    for part, scores in evidence.judged["models"].get("model", {}).items():
        worst, r2 = max(scores["relative_error"]), min(scores["r2"])
        samples = evidence.judged["parts"][part]["samples"]
        error = f"largest error {worst:.3g} of the largest torque"
        yield f"Judged on {part} ({samples} samples), worst axis: {error}, R2 {r2:.4f}"
    for finding in evidence.findings:
        yield f"Finding: {finding}"


def _origin(provenance: Provenance) -> Iterator[str]:
    header = provenance.header
    yield f"Model: {provenance.file}, sha256 {provenance.sha256}"
    yield f"Made by cpfls {header.version}, seed {header.seed}; exported by cpfls {provenance.exporter}"
    for role, source in header.inputs.items():
        yield f"From {role}: {source.name}, sha256 {source.sha256}"
