"""The catalogue: every effect that has a module in it."""

from collections.abc import Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType

from cpfls_cli.effects import catalogue
from cpfls_cli.effects.effect import Effect
from cpfls_cli.errors import InputError
from cpfls_cli.words import did_you_mean


def _discover() -> Mapping[str, Effect]:
    modules = [import_module(f"{catalogue.__name__}.{module.name}") for module in iter_modules(catalogue.__path__)]
    effects: list[Effect] = sorted((module.EFFECT for module in modules), key=lambda known: (known.order, known.name))
    return MappingProxyType({known.name: known for known in effects})


CATALOGUE: Mapping[str, Effect] = _discover()  # Effects by identifier.
VEHICLE_NUMBERS: Effect = next(known for known in CATALOGUE.values() if known.kind == "parameter")
"""The vehicle's own numbers, which stay free in every fit."""

CENTRE_OF_MASS: Effect = next(known for known in CATALOGUE.values() if known.of_all_forces)
"""The effect that has a lever for all forces."""


def effect(name: str) -> Effect:
    """Find an effect by its identifier.

    Raises InputError if there is none of that name; the message gives the nearest ones.
    """
    if name in CATALOGUE:
        return CATALOGUE[name]
    hint = did_you_mean(name, CATALOGUE, "`cpfls effects` lists all", most=3, cutoff=0.5)
    raise InputError(f"{name}: no such effect ({hint})")
