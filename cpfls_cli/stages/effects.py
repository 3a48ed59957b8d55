"""Show the effects that a model can miss, and the flights that distinguish them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import typer

from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.registry import CATALOGUE, effect
from cpfls_cli.result import about, part, plain, result
from cpfls_cli.stage import Run, stage
from cpfls_cli.vehicle.settings import VehicleSettings


@result
class Coefficient:
    """A coefficient of an effect, with its range for the default vehicle."""

    name: str = about("of the coefficient")
    unit: str = about("of its values")
    meaning: str = about("in words")
    low: float = about("lowest value that is looked for", unit="as stated")
    high: float = about("highest value that is looked for", unit="as stated")


@result
class Shape:
    """A number of an effect that is looked for on a grid."""

    name: str = about("of the number")
    unit: str = about("of its values")
    grid: tuple[float, ...] = about("values that a search starts from", "value", unit="as stated")
    meaning: str = about("in words")
    first: float | None = about("where a search stays until the effect is chosen", unit="as stated", default=None)
    valley: float | None = about("width of the valleys of the residual over it, as a share of it", default=None)


@result
class Shown:
    """An effect of the catalogue."""

    name: str = about("of the effect")
    title: str = about("in a few words")
    kind: str = about("where it acts")
    formula: str = about("of its torque or force")
    sentence: str = about("in a sentence")
    coefficients: tuple[Coefficient, ...] = part()
    shapes: tuple[Shape, ...] = part()
    needs: tuple[str, ...] = about("signals that it needs beside rates and torque", "signal")
    seen_in: str = about("where it is seen")
    excitation: str = about("flight that shows it")
    rivals: Mapping[str, str] = about("what looks like it, and how to distinguish the two")
    source: str = about("where the formula is from")


@result
class Catalogue:
    """Effects that a model can miss."""

    vehicle: str = about("whose ranges they are")
    effects: tuple[Shown, ...] = part(brief=False)


NameArgument = Annotated[
    str | None, typer.Argument(metavar="NAME", help="An effect, such as rotor_drag; without it, all are listed.")
]


@stage(Catalogue, output=False)
def effects(run: Run, name: NameArgument = None) -> Catalogue:
    """List the effects, or describe one in full; ranges are those of the default vehicle."""
    vehicle = VehicleSettings()
    shown = tuple(described(each, vehicle) for each in ([effect(name)] if name else CATALOGUE.values()))
    run.also = plain(shown[0]) if name else {"effects": plain(shown)}
    run.next.append(("cpfls", "effects") if name else ("cpfls", "effects", shown[0].name))
    return Catalogue(vehicle=f"default, {vehicle.mass_kg:g} kg with {len(vehicle.rotors)} rotors", effects=shown)


def described(entry: Effect, vehicle: VehicleSettings) -> Shown:
    """Describe an effect, with the ranges of its numbers for a vehicle."""
    # With all numbers that the last fit of a diagnosis finds.
    whole = entry.exact or entry
    ranges = ((each, *each.bounds(vehicle)) for each in whole.coefficients)
    return Shown(
        **{name: getattr(entry, name) for name in ("name", "title", "kind", "formula", "sentence", "excitation")},
        coefficients=tuple(
            Coefficient(name=each.name, unit=each.unit, meaning=each.meaning, low=low, high=high)
            for each, low, high in ranges
        ),
        shapes=tuple(Shape(**vars(each)) for each in whole.shapes),
        needs=tuple(sorted(entry.needs)),
        seen_in="sensors alone" if entry.columns is None else "torque and force",
        rivals=dict(entry.rivals),
        source=entry.source,
    )
