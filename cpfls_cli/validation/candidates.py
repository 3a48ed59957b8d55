"""Structures near that of a model, to compare it with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

from cpfls_cli.fuzzy.inputs import InputMap
from cpfls_cli.regressor.structure import StructureSettings

_FUNCTIONS = (1, 3, 5, 7)
_SEESAW_FUNCTIONS = 5
_INPUT_MAPS: tuple[InputMap, ...] = ("full-circle", "data-range")
_HARMONIC_ORDERS = (1, 2, 3)


def candidates(own: StructureSettings) -> tuple[StructureSettings, ...]:
    """List a structure and others that differ from it in one choice.

    The choices are the number of membership functions, the input map, and the consequents: the triangle wave, or
    harmonics up to the first, second or third order.

    Returns
    -------
    tuple of StructureSettings
        The own one first; structures that are the same model are listed once.
    """
    own = StructureSettings(**{field.name: getattr(own, field.name) for field in fields(StructureSettings)})
    different: dict[tuple[Any, ...], StructureSettings] = {}
    for settings in (own, *_changed(own)):
        different.setdefault(_identity(settings), settings)
    return tuple(different.values())


def structure_name(settings: StructureSettings) -> str:
    """Name a structure in a line.

    Returns
    -------
    str
        As ``harmonic 2 tensor, 1 function, full-circle``.
    """
    harmonic = settings.consequents == "harmonic"
    consequents = f"harmonic {settings.harmonic_order}" if harmonic else "seesaw"
    counts = settings.membership_functions
    number = str(counts) if isinstance(counts, int) else "-".join(map(str, counts))
    functions = f"{number} function" + ("" if counts == 1 else "s")
    classic = ", classic" if settings.structure == "fls" else ""
    return f"{consequents} {settings.products}, {functions}, {settings.input_map}{classic}"


def _changed(own: StructureSettings) -> Iterator[StructureSettings]:
    for functions in _FUNCTIONS:
        yield replace(own, membership_functions=functions)
    products = own.products if own.consequents == "seesaw" else "additive"
    seesaw = replace(own, consequents="seesaw", products=products, membership_functions=_SEESAW_FUNCTIONS)
    for structure in (own, seesaw):
        for input_map in _INPUT_MAPS:
            yield replace(structure, input_map=input_map)
    for order in _HARMONIC_ORDERS:
        yield replace(own, **_harmonic(own, order))


def _harmonic(own: StructureSettings, order: int) -> dict[str, Any]:
    """Give what makes the consequents harmonic; one rule where they were not, for harmonics need no more."""
    changed: dict[str, Any] = {"consequents": "harmonic", "harmonic_order": order}
    if own.consequents == "seesaw":
        changed |= {"structure": "cpfls", "products": "tensor", "membership_functions": 1}
    return changed


def _identity(settings: StructureSettings) -> tuple[Any, ...]:
    """Tell structures apart, leaving out what changes nothing."""
    harmonic = settings.consequents == "harmonic"
    one_rule = settings.membership_functions == 1
    return (
        settings.structure,
        settings.consequents,
        settings.harmonic_order if harmonic else None,
        settings.products,
        settings.membership_functions,
        None if harmonic and one_rule else settings.input_map,
    )
