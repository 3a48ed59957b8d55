"""Vehicles that were found, side by side: their constants, and where two lie beyond the intervals of both."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from cpfls_cli.artifacts.parameters import FOUND_AS, Parameter, parameters_of
from cpfls_cli.pages.source import Sources
from cpfls_cli.pages.trust import model_words
from cpfls_cli.report.content import Cell, Facts, Section, Table
from cpfls_cli.report.numbers import UNKNOWN, number
from cpfls_cli.rounding import less


def compared_vehicles_section(sources: Sources) -> Section | None:
    """Set the constants of several vehicles side by side; None for fewer than two."""
    vehicles = sources.vehicles
    if len(vehicles) < 2:
        return None
    listed = [{each.key: each for each in parameters_of(vehicle.record) if each.needed} for vehicle in vehicles]
    rows: list[list[str | Cell]] = []
    for key in FOUND_AS:
        known = [parameters[key] for parameters in listed if key in parameters]
        if known:
            apart = _apart(known)
            tone = "warning" if apart else "plain"
            values = [Cell(_with_interval(parameters.get(key)), tone) for parameters in listed]
            differ = "beyond both intervals" if apart else ""
            rows.append([f"{known[0].name}, {known[0].unit}", *values, differ])
    header = ("Constant", *(vehicle.label for vehicle in vehicles), "Differ")
    caption = (
        "Constants with 95 % intervals; in brackets what the flights do not tell. Marked where two of them lie beyond "
        "the intervals of both."
    )
    judged = [(vehicle.label, model_words(vehicle.record).sentence) for vehicle in vehicles]
    table = Table("vehicles-compared", caption, header, rows, frozenset(range(len(header))))
    return Section("vehicles", "The vehicles side by side", [Facts(judged), table])


def _apart(known: Sequence[Parameter]) -> bool:
    """Tell whether two numbers lie beyond the intervals of each other; one that was not fitted is known exactly."""
    spans = [
        (each.value, each.value) if each.low is None or each.high is None else (each.low, each.high)
        for each in known
        if each.value is not None
    ]
    ends = [(low, high) for low, high in spans if low is not None and high is not None]
    return any(bool(less(one[1], two[0])) or bool(less(two[1], one[0])) for one, two in combinations(ends, 2))


def _with_interval(parameter: Parameter | None) -> str:
    if parameter is None or parameter.value is None:
        return UNKNOWN
    value = number(parameter.value, 4)
    if parameter.low is None or parameter.high is None:
        return f"{value} ({parameter.told})"
    span = f"{value}, {number(parameter.low, 3)} to {number(parameter.high, 3)}"
    return span if parameter.determined else f"({span})"
