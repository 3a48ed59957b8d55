"""Tables that diagnoses and extended models have in common."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.pages.gap_words import (
    channel_unit,
    channel_words,
    effect_title,
    known_channels,
    probability,
    unit_words,
    whole_percent,
)
from cpfls_cli.pages.source import Source
from cpfls_cli.report.content import Cell, Table
from cpfls_cli.report.numbers import UNKNOWN, number, printed, with_interval

_GROWN = 1.05
_NUMBERS = {
    "inertia": "moment of inertia about",
    "coupling": "coupling of rates about",
    "reference": "offset of the point that the log follows along",
}


def gap_table(name: str, source: Source, caption: str) -> Table:
    """Show the gap of each channel before and after, in its unit and in noise floors.

    Parameters
    ----------
    source : Source
        A diagnosis or an extended model.
    """
    artifact = source.artifact
    keys = ("before", "after", "floor", "before_floors", "after_floors")
    columns = {key: artifact.array(f"gap/{key}") for key in keys}
    rows: list[list[str | Cell]] = []
    for index, channel in known_channels(source, "gap/before"):
        before, after, floor, first, last = (float(columns[key][index]) for key in keys)
        shrunk = Cell(number(last, 2), "warning" if last > max(_GROWN * first, 1.0) else "plain")
        sizes = [number(value, 3) for value in (before, after, floor)]
        rows.append([channel_words(channel), channel_unit(channel), *sizes, number(first, 2), shrunk])
    header = ("Channel", "Unit", "Gap before", "Gap after", "Noise floor", "Before, in floors", "After, in floors")
    return Table(name, caption, header, rows, frozenset({0, 1}))


def effects_table(name: str, source: Source) -> Table:
    """Show how sure each effect is."""
    artifact = source.artifact
    words = [artifact.texts(f"effect/{key}") for key in ("name", "sentence")]
    keys = ("named", "share", "p_value", "selection_frequency")
    numbers = [artifact.array(f"effect/{key}") for key in keys]
    rows = [
        [
            effect_title(effect) if named else f"{effect_title(effect)} (closest only)",
            effect,
            whole_percent(share),
            probability(p_value),
            whole_percent(frequency),
            sentence,
        ]
        for effect, sentence, named, share, p_value, frequency in zip(*words, *numbers, strict=True)
    ]
    caption = (
        "Effects. Share: part of the gap above the floor that comes back without it. p: how often chance explains as "
        "much with any effect of the catalogue. Chosen again: share of the stretches of flight without which it would "
        "still be the first choice."
    )
    header = ("Effect", "Identifier", "Share", "p", "Chosen again", "What it is")
    return Table(name, caption, header, rows, frozenset({0, 1, 5}), frozenset({0, 5}))


def coefficients_table(name: str, source: Source) -> Table:
    """Show the coefficients of the effects with their intervals and ranges."""
    artifact = source.artifact
    words = (artifact.texts(f"coefficient/{key}") for key in ("effect", "name", "unit"))
    keys = ("value", "low", "high", "plausible_low", "plausible_high")
    numbers = (artifact.array(f"coefficient/{key}") for key in keys)
    rows: list[list[str]] = []
    for effect, coefficient, unit, value, low, high, least, largest in zip(*words, *numbers, strict=True):
        first = not rows or effect not in (row[0] for row in rows)
        named = [effect if first else "", _meaning(effect, coefficient)]
        possible = interval(least, largest, 3)
        rows.append([*named, *measured(value, low, high), unit_words(unit), possible])
    caption = "Coefficients with their 95 % intervals, and the range that is physically possible on this vehicle."
    header = ("Effect", "Coefficient", "Value", "95 % interval", "Unit", "Possible")
    return Table(name, caption, header, rows, frozenset({0, 1, 4}), frozenset({1}))


def parameters_table(name: str, source: Source) -> Table:
    """Show the vehicle's own numbers, refitted with the effects."""
    artifact = source.artifact
    words = (artifact.texts(f"parameter/{key}") for key in ("name", "unit"))
    numbers = (artifact.array(f"parameter/{key}") for key in ("value", "low", "high"))
    rows = [list(_parameter(*row)) for row in zip(*words, *numbers, strict=True)]
    caption = (
        "The vehicle's own numbers, refitted with the effects; relative ones are changes against the vehicle file. "
        "Only ratios to the torque of the rotors can be seen."
    )
    return Table(name, caption, ("Number", "Change", "95 % interval", "Unit"), rows, frozenset({0, 3}))


def measured(value: float, low: float, high: float) -> list[str]:
    """Write a value and its interval with the digits that the width of the interval leaves.

    Returns
    -------
    list of str
        Value, interval; the interval is ``—`` where it is not known.
    """
    first, *ends = (printed(text) for text in with_interval(value, low, high))
    return [first, " … ".join(ends) if np.isfinite([low, high]).any() else UNKNOWN]


def interval(low: float, high: float, digits: int = 4) -> str:
    """Write an interval.

    Returns
    -------
    str
        ``—`` where it is not known.
    """
    return f"{number(low, digits)} … {number(high, digits)}" if np.isfinite([low, high]).any() else UNKNOWN


def _meaning(effect: str, coefficient: str) -> str:
    if effect not in CATALOGUE:
        return coefficient
    known = CATALOGUE[effect]
    meanings = {entry.name: entry.meaning for entry in known.coefficients}
    meaning = (meanings | {entry.name: entry.meaning for entry in known.shapes}).get(coefficient)
    return f"{coefficient}: {meaning}" if meaning else coefficient


def _parameter(name: str, unit: str, value: float, low: float, high: float) -> Iterator[str]:
    kind, _, axis = name.rpartition("_")
    yield f"{_NUMBERS[kind]} {axis}" if kind in _NUMBERS else name.replace("_", " ")
    scale = 100.0 if unit == "1" else 1.0
    yield from measured(scale * value, scale * low, scale * high)
    yield "%" if unit == "1" else unit_words(unit)
