"""Durations on the command line."""

from __future__ import annotations

import math

import typer

_UNITS = {"s": 1.0, "m": 60.0, "h": 3600.0}


def seconds(text: str) -> float:
    """Read a duration, such as ``90``, ``90s``, ``10m`` or ``2h``.

    Returns
    -------
    float, s

    Raises
    ------
    typer.BadParameter
        If it is none, or not more than zero.
    """
    unit = _UNITS.get(text[-1:])
    try:
        value = float(text if unit is None else text[:-1]) * (unit or 1.0)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise typer.BadParameter(f"{text!r} is no duration; write 90, 90s, 10m or 2h")
    return value
