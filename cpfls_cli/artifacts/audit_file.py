"""The sensor audit inside an artifact: written, read back, and said."""

from __future__ import annotations

from typing import Any

from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.artifacts.tables import rows_of, table, texts
from cpfls_cli.gap.sensors.audit import Audit
from cpfls_cli.gap.sensors.findings import AuditFinding, FaultNumber

_FINDING = (("finding", "sentence"), ("named", "p_value"))
_NUMBER = (("finding", "name", "unit"), ("value", "low", "high", "named"))


def audit_data(audit: Audit) -> dict[str, Any]:
    """Arrange an audit as datasets."""
    found = [
        {"finding": f.name, "sentence": f.sentence, "named": f.named, "p_value": f.p_value} for f in audit.findings
    ]
    numbers = [{"finding": f.name, **c._asdict()} for f in audit.findings for c in f.coefficients]
    return {
        **table("audit", found, *_FINDING),
        **table("audit_coefficient", numbers, *_NUMBER),
        "audit/untested": texts(f"{name}: {reason}" for name, reason in audit.untested.items()),
        "audit/warning": texts(audit.warnings),
        "audit/note": texts(audit.notes),
    }


def audit_of(artifact: Artifact) -> Audit:
    """Rebuild an audit, as far as repairs need it."""
    numbers = rows_of(artifact, "audit_coefficient", *_NUMBER)
    findings = tuple(
        AuditFinding(
            row["finding"], _coefficients(row["finding"], numbers), row["p_value"], bool(row["named"]), row["sentence"]
        )
        for row in rows_of(artifact, "audit", *_FINDING)
    )
    untested = dict(text.split(": ", 1) for text in artifact.texts("audit/untested"))
    warnings, notes = artifact.texts("audit/warning"), artifact.texts("audit/note")
    return Audit(findings, untested, tuple(warnings), tuple(notes), None, (), None)


def audit_summary(audit: Audit) -> dict[str, Any]:
    """Describe an audit for machines."""
    return {
        "findings": [
            {
                "name": finding.name,
                "named": finding.named,
                "p_value": finding.p_value,
                "sentence": finding.sentence,
                "coefficients": {
                    c.name: {"value": c.value, "unit": c.unit, "low": c.low, "high": c.high}
                    for c in finding.coefficients
                },
            }
            for finding in audit.findings
        ],
        "untested": dict(audit.untested),
        "warnings": list(audit.warnings),
        "notes": list(audit.notes),
    }


def audit_lines(audit: Audit) -> list[str]:
    """Say what an audit found."""
    named = [f"sensors: {finding.sentence}" for finding in audit.named]
    if not audit.findings:
        reason = next(iter(audit.untested.values()), "nothing to compare them with")
        named = [f"sensors: not tested: {reason}."]
    return [*(named or ["sensors: no fault that matters."]), *(f"sensors: {note}" for note in audit.notes)]


def _coefficients(finding: str, numbers: list[dict[str, Any]]) -> tuple[FaultNumber, ...]:
    own = [
        {key: value for key, value in row.items() if key != "finding"} for row in numbers if row["finding"] == finding
    ]
    return tuple(FaultNumber(**{**row, "named": bool(row["named"])}) for row in own)
