"""Show the effects that a model can miss, and the flights that distinguish them."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.registry import CATALOGUE, effect
from cpfls_cli.stage import Run, stage
from cpfls_cli.vehicle.settings import VehicleSettings

NameArgument = Annotated[
    str | None, typer.Argument(metavar="NAME", help="An effect, such as rotor_drag; without it, all are listed.")
]


@stage(dict, output=False)
def effects(run: Run, name: NameArgument = None) -> dict[str, Any]:
    """List the effects, or describe one in full; ranges are those of the default vehicle."""
    vehicle = VehicleSettings()
    shown = tuple(described(each, vehicle) for each in ([effect(name)] if name else CATALOGUE.values()))
    about = {"vehicle": f"default, {vehicle.mass_kg:g} kg with {len(vehicle.rotors)} rotors"}
    run.also = about | (shown[0] if name else {"effects": shown})
    run.next.append(("cpfls", "effects") if name else ("cpfls", "effects", shown[0]["name"]))
    return about | {"effects": shown}


def described(entry: Effect, vehicle: VehicleSettings) -> dict[str, Any]:
    """Describe an effect, with the ranges of its numbers for a vehicle."""
    # With all numbers that the last fit of a diagnosis finds.
    whole = entry.exact or entry
    ranges = ((each, *each.bounds(vehicle)) for each in whole.coefficients)
    return {
        **{name: getattr(entry, name) for name in ("name", "title", "kind", "formula", "sentence")},
        "coefficients": [
            {"name": each.name, "unit": each.unit, "meaning": each.meaning, "low": low, "high": high}
            for each, low, high in ranges
        ],
        "shapes": [
            {name: getattr(each, name) for name in ("name", "unit", "grid", "meaning", "first", "valley")}
            for each in whole.shapes
        ],
        "needs": sorted(entry.needs),
        "seen_in": "sensors alone" if entry.columns is None else "torque and force",
        "excitation": entry.excitation,
        "rivals": entry.rivals,
        "source": entry.source,
    }
