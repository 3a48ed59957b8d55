"""The catalogue: every effect that has a module in it."""

from collections.abc import Mapping
from functools import lru_cache
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType

from cpfls_cli.effects import catalogue
from cpfls_cli.effects.effect import Effect
from cpfls_cli.errors import InputError
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import did_you_mean

_MODULES = [import_module(f"{catalogue.__name__}.{module.name}") for module in iter_modules(catalogue.__path__)]
_EFFECTS: list[Effect] = sorted((own.EFFECT for own in _MODULES), key=lambda known: (known.order, known.name))
CATALOGUE: Mapping[str, Effect] = MappingProxyType({known.name: known for known in _EFFECTS})  # By identifier.
VEHICLE_NUMBERS: Effect = next(known for known in CATALOGUE.values() if known.kind == "parameter")
"""The vehicle's own numbers, which stay free in every fit."""

CENTRE_OF_MASS: Effect = next(known for known in CATALOGUE.values() if known.of_all_forces)
"""The effect that has a lever for all forces."""

SUPPLY: Effect = next(known for known in CATALOGUE.values() if known.actuation and known.actuation.supply)
"""The effect of the voltage of a supply."""

THRUST_CURVE: Effect = next(known for known in CATALOGUE.values() if known.tried_last)
"""The effect of a thrust that is no square of what drives the rotors."""


@lru_cache(maxsize=256)
def acting(name: str, vehicle: VehicleSettings) -> Effect:
    """Give an effect with the coefficients that act on a vehicle: optional ones need six rotors or more."""
    known = CATALOGUE[name]
    fewer = min(len(known.coefficients), len(known.numbers) - known.optional)
    return known if len(vehicle.rotors) >= 6 else known.form(fewer, ())


def effect(name: str) -> Effect:
    """Find an effect by its identifier.

    Raises InputError if there is none of that name; the message gives the nearest ones.
    """
    if name in CATALOGUE:
        return CATALOGUE[name]
    hint = did_you_mean(name, CATALOGUE, "`cpfls effects` lists all", most=3, cutoff=0.5)
    raise InputError(f"{name}: no such effect ({hint})")
