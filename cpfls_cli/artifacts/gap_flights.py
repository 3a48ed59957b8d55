"""What a comparison of a model with flights starts from, as groups of datasets: flights, sensors, base model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.spec import BODY, EULER, WORLD, columns_of, dataset, group, record, rows_of

if TYPE_CHECKING:
    # Reading a record does not need the compiled kernels that evaluate a model.
    from cpfls_cli.config.study import Study
    from cpfls_cli.consistency.audit import Audit
    from cpfls_cli.consistency.faults import AuditFinding, FaultNumber
    from cpfls_cli.consistency.repairs import ChannelRepair
    from cpfls_cli.effects.signals import Signals
    from cpfls_cli.gap.naming.results import NotExcited
    from cpfls_cli.weak_form.windows import Recording

RIGID_BODY = "rigid-body"
"""Kind of a base that is the rigid body of the vehicle."""

TRAINING, HELD_OUT = "training", "held-out"
"""Roles of the flights of a diagnosis."""


@record
class NotExcitedGroup:
    """Effects that could be there unseen."""

    name: tuple[str, ...] = dataset("name", "effects that could be there unseen", "unseen")
    reason: tuple[str, ...] = dataset(
        "reason", "why: signals that are lacking, or the flight that would show it", "unseen"
    )

    @classmethod
    def of(cls, unseen: Sequence[NotExcited]) -> Self:
        """Arrange effects that flights could not show."""
        return columns_of(cls, unseen)

    @property
    def by_reason(self) -> dict[str, list[str]]:
        """Names of the effects by the reason that they have in common."""
        return _grouped(zip(self.name, self.reason, strict=True))

    @property
    def summary(self) -> list[dict[str, Any]]:
        """The effects for machines."""
        return rows_of(self)


@record
class AuditCoefficientGroup:
    """Numbers of the faults of sensors."""

    finding: tuple[str, ...] = dataset("finding", "fault that each number belongs to", "audit_number")
    name: tuple[str, ...] = dataset("name", "name of the number", "audit_number")
    unit: tuple[str, ...] = dataset("unit", "unit of the number", "audit_number")
    value: Array = dataset("value", "estimate", "audit_number", units="SI")
    low: Array = dataset("low", "lower end of the 95 % interval", "audit_number", units="SI", gaps=True)
    high: Array = dataset("high", "upper end of the 95 % interval", "audit_number", units="SI", gaps=True)
    named: Array = dataset("named", "1 where it is sure and of practical size", "audit_number")

    @classmethod
    def of(cls, findings: Sequence[AuditFinding]) -> Self:
        """Arrange the numbers of all faults that were tested."""
        owners = tuple(finding.name for finding in findings for _ in finding.coefficients)
        return columns_of(cls, (number for finding in findings for number in finding.coefficients), finding=owners)

    def of_finding(self, finding: str) -> tuple[FaultNumber, ...]:
        """Rebuild the numbers of one fault."""
        from cpfls_cli.consistency.faults import FaultNumber

        rows = [row for row in rows_of(self) if row.pop("finding") == finding]
        return tuple(FaultNumber(**{**row, "named": bool(row["named"])}) for row in rows)


@record
class AuditRepairGroup:
    """Channels that contradict the others, and how they are set right."""

    channel: tuple[str, ...] = dataset("channel", "channels that are set right or left out, in that order", "repair")
    dropped: Array = dataset("dropped", "1 where it is left out, and nothing else counts", "repair")
    delay_s: Array = dataset("delay", "how late it is", "repair", units="s")
    in_body: Array = dataset("in_body", "1 where world axes were logged in body axes", "repair")
    matrix: Array = dataset("matrix", "unit and axes, after the turn to world axes", "repair", "axis", "axis")
    gravity_m_s2: Array = dataset("gravity", "added along the vertical, last", "repair", units="m/s^2")
    sentence: tuple[str, ...] = dataset("sentence", "what is wrong, who says so, and what to mend", "repair")

    @classmethod
    def of(cls, repairs: Sequence[ChannelRepair]) -> Self | None:
        """Arrange repairs; None where there are none."""
        return columns_of(cls, repairs) if repairs else None

    def repairs(self) -> tuple[ChannelRepair, ...]:
        """Rebuild the repairs."""
        from cpfls_cli.consistency.repairs import ChannelRepair

        rows = rows_of(self)
        for row in rows:
            row |= {name: bool(row[name]) for name in ("dropped", "in_body")} | {"matrix": np.array(row["matrix"])}
        return tuple(ChannelRepair(**row) for row in rows)


@record
class AuditGroup:
    """What the sensors say about each other."""

    finding: tuple[str, ...] = dataset("audit/finding", "faults of sensors that were tested", "finding")
    named: Array = dataset("audit/named", "1 where the fault is sure and matters", "finding")
    p_value: Array = dataset("audit/p_value", "probability that chance shows as much", "finding")
    sentence: tuple[str, ...] = dataset("audit/sentence", "what was found, in words", "finding")
    coefficient: AuditCoefficientGroup = group("audit_coefficient")
    untested: tuple[str, ...] = dataset(
        "audit/untested", "faults that could not be tested, with the reason", "untested"
    )
    warning: tuple[str, ...] = dataset(
        "audit/warning", "channels that disagree or look broken; nothing is repaired for them", "audit_warning"
    )
    note: tuple[str, ...] = dataset("audit/note", "for information", "audit_note")
    repair: AuditRepairGroup | None = group("audit_repair", default=None)
    contradiction: tuple[str, ...] | None = dataset(
        "audit/contradiction", "what no verdict can stand beside; nothing repairs it", "contradiction", default=None
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
            repair=AuditRepairGroup.of(audit.repairs),
            contradiction=audit.contradictions or None,
        )

    def audit(self) -> Audit:
        """Rebuild the audit, as far as repairs need it."""
        from cpfls_cli.consistency.audit import Audit

        repairs = () if self.repair is None else self.repair.repairs()
        return Audit(
            self.findings,
            self.untested_because,
            self.warning,
            self.note,
            repairs=repairs,
            contradictions=self.contradiction or (),
        )

    @property
    def findings(self) -> tuple[AuditFinding, ...]:
        """Faults that were tested."""
        from cpfls_cli.consistency.faults import AuditFinding

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
        return _grouped(self.untested_because.items())

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


def _grouped(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """Gather names by their reason."""
    reasons: dict[str, list[str]] = {}
    for name, reason in pairs:
        reasons.setdefault(reason, []).append(name)
    return reasons


@record
class FlightGroup:
    """What each flight is, and where its samples begin."""

    name: tuple[str, ...] = dataset("name", "file name, with the part of it where one flight was split", "flight")
    role: tuple[str, ...] = dataset("role", "given, training or held-out", "flight")
    first: IntArray = dataset("first", "index of the first sample of each flight", "flight")
    commanded: IntArray = dataset(
        "commanded", "1 where actuation is what was asked for, not what was measured", "flight"
    )

    @classmethod
    def of(cls, recordings: Sequence[Recording], roles: Sequence[str]) -> Self:
        """Say what each flight is.

        Parameters
        ----------
        roles : sequence of str
            Of each: given, training or held-out.
        """
        lengths = [len(recording.signals) for recording in recordings]
        return cls(
            name=tuple(recording.name for recording in recordings),
            role=tuple(roles),
            first=np.cumsum([0, *lengths[:-1]]),
            commanded=np.array([int(recording.signals.commanded) for recording in recordings]),
        )


@record
class SignalsGroup:
    """Signals of all flights; not finite in a flight that lacks one."""

    time: Array = dataset("time", "time on the clock of the flight", "sample", units="s")
    body_rate: Array = dataset(
        "body_rate", "body rates p, q, r, as logged", "sample", "axis", units="rad/s", frame=BODY
    )
    attitude: Array | None = dataset(
        "attitude", "roll, pitch, yaw", "sample", "axis", units="rad", frame=EULER, gaps=True, default=None
    )
    velocity: Array | None = dataset(
        "velocity", "velocity", "sample", "axis", units="m/s", frame=WORLD, gaps=True, default=None
    )
    position: Array | None = dataset(
        "position", "position", "sample", "axis", units="m", frame=WORLD, gaps=True, default=None
    )
    acceleration: Array | None = dataset(
        "acceleration", "acceleration", "sample", "axis", units="m/s^2", frame=WORLD, gaps=True, default=None
    )
    specific_force: Array | None = dataset(
        "specific_force",
        "what an accelerometer senses",
        "sample",
        "axis",
        units="m/s^2",
        frame=BODY,
        gaps=True,
        default=None,
    )
    rotor_speed: Array | None = dataset(
        "rotor_speed",
        "rotor speeds, measured or commanded",
        "sample",
        "rotor",
        units="rad/s",
        frame=BODY,
        gaps=True,
        default=None,
    )
    stated_torque: Array | None = dataset(
        "stated_torque",
        "torque of a log without rotor speeds",
        "sample",
        "axis",
        units="N m",
        frame=BODY,
        gaps=True,
        default=None,
    )
    stated_thrust: Array | None = dataset(
        "stated_thrust", "thrust of such a log, along body z", "sample", units="N", frame=BODY, gaps=True, default=None
    )
    voltage: Array | None = dataset(
        "voltage", "of the battery, as a share of the full one", "sample", gaps=True, default=None
    )

    @classmethod
    def of(cls, recordings: Sequence[Recording]) -> Self:
        """Put the signals of flights one after another."""
        lengths = [len(recording.signals) for recording in recordings]
        joined = {
            field.name: _joined([getattr(recording.signals, field.name) for recording in recordings], lengths)
            for field in fields(cls)
        }
        return cls(**joined)  # type: ignore[arg-type]  # every flight has time and rates

    def part(self, samples: slice, commanded: bool, study: Study) -> Signals:
        """Rebuild the signals of one flight, with the vehicle and the ground of a study."""
        from cpfls_cli.effects.signals import Signals

        known = {
            field.name: values[samples] for field in fields(self) if (values := getattr(self, field.name)) is not None
        }
        # A flight that lacks a signal lacks all of it.
        whole = {name: values for name, values in known.items() if np.isfinite(values).all()}
        ground = study.gap.ground_height_m
        return Signals(vehicle=study.vehicle, commanded=commanded, ground_height_m=ground, **whole)


def _joined(parts: Sequence[Array | None], lengths: Sequence[int]) -> Array | None:
    shape = next((part.shape[1:] for part in parts if part is not None), None)
    if shape is None:
        return None
    filled = [
        np.full((length, *shape), np.nan) if part is None else part for part, length in zip(parts, lengths, strict=True)
    ]
    return np.concatenate(filled)


@record
class FlightsGroup:
    """Flights that later stages read, one after another along the samples."""

    each: FlightGroup = group("flight")
    signals: SignalsGroup = group("signals")

    @classmethod
    def of(cls, recordings: Sequence[Recording], roles: Sequence[str]) -> Self:
        """Put flights one after another.

        Parameters
        ----------
        roles : sequence of str
            Of each: given, training or held-out.
        """
        return cls(each=FlightGroup.of(recordings, roles), signals=SignalsGroup.of(recordings))

    def names(self, *roles: str) -> list[str]:
        """List the names of the flights in these roles; of all if none is named."""
        pairs = zip(self.each.name, self.each.role, strict=True)
        return [name for name, role in pairs if not roles or role in roles]

    def recordings(self, study: Study, *roles: str) -> list[Recording]:
        """Rebuild the flights in these roles; all if none is named."""
        from cpfls_cli.weak_form.windows import Recording

        each = self.each
        last = [*each.first[1:], len(self.signals.time)]
        columns = zip(each.name, each.role, each.first, last, each.commanded, strict=True)
        return [
            Recording(name, self.signals.part(slice(start, stop), bool(commanded), study))
            for name, role, start, stop, commanded in columns
            if not roles or role in roles
        ]
