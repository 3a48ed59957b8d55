"""`effects`: print the catalogue of effects, or all of one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from cpfls_cli.effects.effect import Coefficient, Effect, Shape
from cpfls_cli.effects.registry import CATALOGUE, effect
from cpfls_cli.report.content import Block, Facts, Table, Text
from cpfls_cli.report.outcome import Outcome
from cpfls_cli.vehicle.settings import VehicleSettings


def run(name: str | None) -> Outcome:
    """List the effects, or describe one in full; ranges are those of the default vehicle."""
    if name is None:
        entries = [_describe_effect(entry) for entry in CATALOGUE.values()]
        rows = [[entry.name, entry.kind, entry.title] for entry in CATALOGUE.values()]
        table = Table("effects", "", ("Effect", "Kind", "What it is"), rows, frozenset({0, 1, 2}))
        hint = Text("`cpfls effects NAME` tells everything on one.")
        return Outcome({"vehicle": _vehicle_name(), "effects": entries}, (table, hint))
    chosen = effect(name)
    return Outcome({"vehicle": _vehicle_name(), **_describe_effect(chosen)}, tuple(_effect_blocks(chosen)))


def _vehicle_name() -> str:
    vehicle = VehicleSettings()
    return f"default, {vehicle.mass_kg:g} kg with {len(vehicle.rotors)} rotors"


def _describe_effect(entry: Effect) -> dict[str, Any]:
    return {
        "name": entry.name,
        "title": entry.title,
        "kind": entry.kind,
        "formula": entry.formula,
        "sentence": entry.sentence,
        "coefficients": [_describe_coefficient(coefficient) for coefficient in _whole(entry).coefficients],
        "shapes": [vars(shape) for shape in _whole(entry).shapes],
        "needs": sorted(entry.needs),
        "seen_in": "sensors alone" if entry.columns is None else "torque and force",
        "excitation": entry.excitation,
        "rivals": dict(entry.rivals),
        "source": entry.source,
    }


def _whole(entry: Effect) -> Effect:
    """Give an effect with all numbers that the last fit of a diagnosis finds."""
    return entry.exact or entry


def _describe_coefficient(coefficient: Coefficient) -> dict[str, Any]:
    low, high = coefficient.bounds(VehicleSettings())
    described = {"name": coefficient.name, "unit": coefficient.unit, "meaning": coefficient.meaning}
    return {**described, "low": low, "high": high}


def _effect_blocks(entry: Effect) -> Iterator[Block]:
    yield Text(f"{entry.name}: {entry.title} ({entry.kind})")
    facts = [("", entry.sentence), ("formula", entry.formula)]
    facts.append(("needs", ", ".join(sorted(entry.needs)) or "rates and torque alone"))
    facts += [("coefficient", _coefficient_text(coefficient)) for coefficient in _whole(entry).coefficients]
    facts += [("shape", _shape_text(shape)) for shape in _whole(entry).shapes]
    if entry.coefficients:
        facts.append(("", f"Ranges are for the vehicle: {_vehicle_name()}."))
    facts.append(("excitation", entry.excitation))
    facts += [("looks like", f"{rival}; to tell: {flight}") for rival, flight in entry.rivals.items()]
    yield Facts([*facts, ("source", entry.source)])


def _coefficient_text(coefficient: Coefficient) -> str:
    low, high = coefficient.bounds(VehicleSettings())
    return f"{coefficient.name} from {low:.3g} to {high:.3g}{_unit(coefficient.unit)}: {coefficient.meaning}"


def _shape_text(shape: Shape) -> str:
    return f"{shape.name} from {shape.grid[0]:g} to {shape.grid[-1]:g}{_unit(shape.unit)}: {shape.meaning}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"
