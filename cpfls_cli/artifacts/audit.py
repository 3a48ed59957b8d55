"""What sensors say of each other, as groups of datasets: faults, channels set right, contradictions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.spec import columns_of, dataset, group, record, rows_of
from cpfls_cli.consistency.findings import AuditFinding, FaultNumber

if TYPE_CHECKING:
    from cpfls_cli.consistency.audit import Audit


@record
class AuditCoefficientGroup:
    """Numbers of the faults of sensors."""

    finding: tuple[str, ...] = dataset("fault that each number belongs to", "audit_number")
    name: tuple[str, ...] = dataset("name of the number", "audit_number")
    unit: tuple[str, ...] = dataset("unit of the number", "audit_number")
    value: Array = dataset("estimate", "audit_number", units="SI")
    low: Array = dataset("lower end of the 95 % interval", "audit_number", units="SI", gaps=True)
    high: Array = dataset("upper end of the 95 % interval", "audit_number", units="SI", gaps=True)
    named: Array = dataset("1 where it is certain and of practical size", "audit_number")

    @classmethod
    def of(cls, findings: Sequence[AuditFinding]) -> Self:
        """Arrange the numbers of all faults that were tested."""
        owners = tuple(finding.name for finding in findings for _ in finding.coefficients)
        return columns_of(cls, (number for finding in findings for number in finding.coefficients), finding=owners)

    def of_finding(self, finding: str) -> tuple[FaultNumber, ...]:
        """Rebuild the numbers of one fault."""
        rows = [row for row in rows_of(self) if row.pop("finding") == finding]
        return tuple(FaultNumber(**{**row, "named": bool(row["named"])}) for row in rows)


@record
class AuditRepairGroup:
    """Channels that contradict the others, and how they are set right."""

    channel: tuple[str, ...] = dataset("channels that are corrected or left out, in that order", "repair")
    dropped: Array = dataset("1 where it is left out, and nothing else counts", "repair")
    delay_s: Array = dataset("how late it is", "repair", path="delay", units="s")
    in_body: Array = dataset("1 where world axes were logged in body axes", "repair")
    matrix: Array = dataset("unit and axes, after the turn to world axes", "repair", "axis", "axis")
    gravity_m_s2: Array = dataset("added along the vertical, last", "repair", path="gravity", units="m/s^2")
    sentence: tuple[str, ...] = dataset("what is wrong, what shows it, and what to correct", "repair")


@record
class AuditGroup:
    """What the sensors say about each other."""

    finding: tuple[str, ...] = dataset("faults of sensors that were tested", "finding", path="audit/finding")
    named: Array = dataset("1 where the fault is certain and matters", "finding", path="audit/named")
    p_value: Array = dataset("probability that chance shows as much", "finding", path="audit/p_value")
    sentence: tuple[str, ...] = dataset("what was found, in words", "finding", path="audit/sentence")
    coefficient: AuditCoefficientGroup = group("audit_coefficient")
    untested: tuple[str, ...] = dataset(
        "faults that could not be tested, with the reason", "untested", path="audit/untested"
    )
    warning: tuple[str, ...] = dataset(
        "channels that disagree or look broken; nothing is repaired for them", "audit_warning", path="audit/warning"
    )
    note: tuple[str, ...] = dataset("for information", "audit_note", path="audit/note")
    repair: AuditRepairGroup | None = group("audit_repair", default=None)
    contradiction: tuple[str, ...] | None = dataset(
        "contradictions that rule out a verdict; nothing repairs them",
        "contradiction",
        path="audit/contradiction",
        default=None,
    )

    @classmethod
    def of(cls, audit: Audit) -> Self:
        """Arrange an audit."""
        findings = audit.findings
        return cls(
            finding=tuple(finding.name for finding in findings),
            named=np.fromiter((finding.named for finding in findings), float),
            p_value=np.fromiter((finding.p_value for finding in findings), float),
            sentence=tuple(finding.sentence for finding in findings),
            coefficient=AuditCoefficientGroup.of(audit.findings),
            untested=tuple(f"{name}: {reason}" for name, reason in audit.untested.items()),
            warning=audit.warnings,
            note=audit.notes,
            repair=columns_of(AuditRepairGroup, audit.repairs) if audit.repairs else None,
            contradiction=audit.contradictions or None,
        )

    @property
    def findings(self) -> tuple[AuditFinding, ...]:
        """Faults that were tested."""
        columns = zip(self.finding, self.p_value.tolist(), self.named, self.sentence, strict=True)
        return tuple(
            AuditFinding(name, self.coefficient.of_finding(name), p_value, bool(named), sentence)
            for name, p_value, named, sentence in columns
        )

    @property
    def faults(self) -> tuple[str, ...]:
        """Sentences on the faults that are sure and matter."""
        return tuple(sentence for sentence, named in zip(self.sentence, self.named, strict=True) if named)

    @property
    def settled(self) -> tuple[str, ...]:
        """Sentences on the channels that were set right or left out."""
        return () if self.repair is None else tuple(sentence for sentence in self.repair.sentence if sentence)

    @property
    def untested_because(self) -> dict[str, str]:
        """Reasons of the faults that could not be tested, by fault."""
        return dict(text.split(": ", 1) for text in self.untested)

    @property
    def untested_by_reason(self) -> dict[str, list[str]]:
        """Faults that could not be tested, by the reason that they have in common."""
        return by_reason(self.untested_because.items())

    @property
    def summary(self) -> dict[str, Any]:
        """The audit for machines."""
        return {
            "findings": [_finding_summary(finding) for finding in self.findings],
            "untested": self.untested_because,
            "warnings": list(self.warning),
            "contradictions": list(self.contradiction or ()),
            "notes": list(self.note),
            "repairs": [] if self.repair is None else rows_of(self.repair),
        }


def _finding_summary(finding: AuditFinding) -> dict[str, Any]:
    return {
        "name": finding.name,
        "named": finding.named,
        "p_value": finding.p_value,
        "sentence": finding.sentence,
        "coefficients": {
            number.name: {"value": number.value, "unit": number.unit, "low": number.low, "high": number.high}
            for number in finding.coefficients
        },
    }


def by_reason(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """Gather names by the reason that they have in common."""
    reasons: dict[str, list[str]] = {}
    for name, reason in pairs:
        reasons.setdefault(reason, []).append(name)
    return reasons
