"""Stage `effects`: what a model can miss, as a table, or one effect in full."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap
from typing import Any

from cpfls_cli.effects.effect import Coefficient, Effect, Shape
from cpfls_cli.effects.registry import CATALOGUE, effect
from cpfls_cli.report.outcome import Outcome
from cpfls_cli.vehicle.settings import VehicleSettings

_LABEL = 12
_WIDTH = 80


def show(name: str | None) -> Outcome:
    """List the effects, or tell everything on one; ranges are those of the default vehicle.

    Parameters
    ----------
    name : str or None
        Identifier; None lists all.

    Raises
    ------
    InputError
        If there is no such effect.
    """
    if name is None:
        entries = [_describe(entry) for entry in CATALOGUE.values()]
        return Outcome({"vehicle": _vehicle_name(), "effects": entries}, tuple(_table()))
    chosen = effect(name)
    return Outcome({"vehicle": _vehicle_name(), **_describe(chosen)}, tuple(_page(chosen)))


def _vehicle_name() -> str:
    vehicle = VehicleSettings()
    return f"default, {vehicle.mass_kg:g} kg with {len(vehicle.rotors)} rotors"


def _describe(entry: Effect) -> dict[str, Any]:
    return {
        "name": entry.name,
        "title": entry.title,
        "kind": entry.kind,
        "formula": entry.formula,
        "sentence": entry.sentence,
        "coefficients": [_describe_coefficient(coefficient) for coefficient in entry.coefficients],
        "shapes": [vars(shape) for shape in entry.shapes],
        "needs": sorted(entry.needs),
        "seen_in": "sensors alone" if entry.columns is None else "torque and force",
        "excitation": entry.excitation,
        "rivals": dict(entry.rivals),
        "source": entry.source,
    }


def _describe_coefficient(coefficient: Coefficient) -> dict[str, Any]:
    low, high = coefficient.bounds(VehicleSettings())
    described = {"name": coefficient.name, "unit": coefficient.unit, "meaning": coefficient.meaning}
    return {**described, "low": low, "high": high}


def _table() -> Iterator[str]:
    width = max(map(len, CATALOGUE))
    for name, entry in CATALOGUE.items():
        yield f"{name:{width}}  {entry.kind:9}  {entry.title}"
    yield "`cpfls effects NAME` tells everything on one."


def _page(entry: Effect) -> Iterator[str]:
    yield f"{entry.name}: {entry.title} ({entry.kind})"
    yield from _paragraph("", entry.sentence)
    yield from _paragraph("formula", entry.formula)
    yield from _paragraph("needs", ", ".join(sorted(entry.needs)) or "rates and torque alone")
    for coefficient in entry.coefficients:
        yield from _paragraph("coefficient", _coefficient_text(coefficient))
    for shape in entry.shapes:
        yield from _paragraph("shape", _shape_text(shape))
    if entry.coefficients:
        yield from _paragraph("", f"Ranges are for the vehicle: {_vehicle_name()}.")
    yield from _paragraph("excitation", entry.excitation)
    for rival, flight in entry.rivals.items():
        yield from _paragraph("looks like", f"{rival}; to tell: {flight}")
    yield from _paragraph("source", entry.source)


def _coefficient_text(coefficient: Coefficient) -> str:
    low, high = coefficient.bounds(VehicleSettings())
    return f"{coefficient.name} from {low:.3g} to {high:.3g}{_unit(coefficient.unit)}: {coefficient.meaning}"


def _shape_text(shape: Shape) -> str:
    return f"{shape.name} from {shape.grid[0]:g} to {shape.grid[-1]:g}{_unit(shape.unit)}: {shape.meaning}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _paragraph(label: str, text: str) -> Iterator[str]:
    for number, line in enumerate(wrap(text, _WIDTH - _LABEL)):
        yield f"{label if number == 0 else '':{_LABEL}}{line}"
