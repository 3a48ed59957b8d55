"""Faults of sensors under the names that the catalogue gives their numbers."""

from __future__ import annotations

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.gap.sensors.audit_findings import AuditFinding
from cpfls_cli.vehicle.settings import VehicleSettings


def sensor_estimates(finding: AuditFinding, vehicle: VehicleSettings) -> tuple[Estimate, ...]:
    """Give the named numbers of a fault."""
    effect = CATALOGUE[finding.name]
    assert effect.test is not None, "the audit tests what has a test"
    by_label = dict(zip(effect.test.labels, effect.numbers, strict=True))
    return tuple(
        Estimate(known.name, known.unit, number.value, number.low, number.high, known.bounds(vehicle))
        for number in finding.coefficients
        if number.named and (known := by_label[number.name])
    )
