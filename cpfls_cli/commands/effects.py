"""`effects`: print the catalogue of effects, or all of one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from cpfls_cli.effects.effect import Coefficient, Effect, Shape
from cpfls_cli.effects.registry import CATALOGUE, effect
from cpfls_cli.report.content import Block, Facts, Folded, Table, Text
from cpfls_cli.report.outcome import Outcome
from cpfls_cli.vehicle.settings import VehicleSettings


def run(name: str | None) -> Outcome:
    """List the effects, or describe one in full; ranges are those of the default vehicle."""
    if name is None:
        entries = [_describe_effect(entry) for entry in CATALOGUE.values()]
        rows = [[entry.name, entry.kind, entry.title] for entry in CATALOGUE.values()]
        table = Table("effects", "", ("Effect", "Kind", "What it is"), rows, frozenset({0, 1, 2}))
        kinds = dict.fromkeys(entry.kind for entry in CATALOGUE.values())
        names = [(kind, ", ".join(each.name for each in CATALOGUE.values() if each.kind == kind)) for kind in kinds]
        blocks = (Facts(names), Folded("what each is", [table]))
        example = ("cpfls", "effects", next(iter(CATALOGUE)))
        return Outcome({"vehicle": _vehicle_name(), "effects": entries}, blocks, next=(example,))
    chosen = effect(name)
    flown = ("cpfls", "effects")
    return Outcome(
        {"vehicle": _vehicle_name(), **_describe_effect(chosen)}, tuple(_effect_blocks(chosen)), next=(flown,)
    )


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
    numbers = [_coefficient_range(each) for each in _whole(entry).coefficients]
    numbers += [_shape_range(each) for each in _whole(entry).shapes]
    yield Facts(
        [
            ("", entry.sentence),
            ("formula", entry.formula),
            ("needs", ", ".join(sorted(entry.needs)) or "rates and torque alone"),
            *([("numbers", f"{', '.join(numbers)} (of the vehicle: {_vehicle_name()})")] if numbers else []),
            ("excitation", entry.excitation),
            ("looks like", ", ".join(entry.rivals)),
        ]
    )
    meanings = [(each.name, each.meaning) for each in _whole(entry).coefficients]
    meanings += [(each.name, each.meaning) for each in _whole(entry).shapes]
    more = [*meanings, *entry.rivals.items(), ("source", entry.source)]
    yield Folded("what its numbers mean, how to tell it from what looks like it, its source", [Facts(more)])


def _coefficient_range(coefficient: Coefficient) -> str:
    low, high = coefficient.bounds(VehicleSettings())
    return f"{coefficient.name} from {low:.3g} to {high:.3g}{_unit(coefficient.unit)}"


def _shape_range(shape: Shape) -> str:
    return f"{shape.name} from {shape.grid[0]:g} to {shape.grid[-1]:g}{_unit(shape.unit)}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"
