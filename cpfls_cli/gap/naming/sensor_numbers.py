"""Faults of sensors under the names that the catalogue gives their numbers."""

from __future__ import annotations

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.gap.sensors.audit_findings import AuditFinding
from cpfls_cli.vehicle.settings import VehicleSettings


def sensor_estimates(finding: AuditFinding, vehicle: VehicleSettings) -> tuple[Estimate, ...]:
    """Give the named numbers of a fault."""
    known = _known(finding.name, vehicle)
    return tuple(
        Estimate(*known[number.name][:2], number.value, number.low, number.high, known[number.name][2])
        for number in finding.coefficients
        if number.named
    )


def _known(name: str, vehicle: VehicleSettings) -> dict[str, tuple[str, str, tuple[float, float]]]:
    """Give name, unit and plausible range by the label of the audit: an axis, or the delay."""
    effect = CATALOGUE[name]
    axes = {c.name.rsplit("_", 1)[-1]: (c.name, c.unit, c.bounds(vehicle)) for c in effect.coefficients}
    delays = [("delay", (shape.name, shape.unit, (shape.grid[0], shape.grid[-1]))) for shape in effect.shapes]
    return axes | dict(delays)
