"""Units that a flight log may use, and their conversion to SI."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from math import pi
from types import MappingProxyType
from typing import Final, Literal

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError

SPEED_UNITS = frozenset({"rad/s", "rpm"})
"""Units in which a rotor command is a speed."""

RPM: Final = 30 / pi
"""Revolutions a minute of 1 rad/s."""

STANDARD_GRAVITY: Final = 9.80665
"""m/s^2, by definition; scipy.constants takes 0.1 s to load."""

UnitName = Literal[
    "1",
    "s",
    "ms",
    "us",
    "ns",
    "rad",
    "deg",
    "rad/s",
    "deg/s",
    "rpm",
    "m",
    "mm",
    "m/s",
    "mm/s",
    "m/s^2",
    "g",
    "N·m",
    "N m",
    "N mm",
    "N",
    "V",
]


@dataclass(frozen=True)
class Unit:
    """A unit of measurement.

    Attributes
    ----------
    factor : float
        Value in SI of one of this unit.
    si : str
        The SI unit of the same quantity; two units are comparable where it is equal.
    """

    factor: float
    si: str


_FACTORS = {
    "1": {"1": 1.0},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "rad": {"rad": 1.0, "deg": pi / 180},
    "rad/s": {"rad/s": 1.0, "deg/s": pi / 180, "rpm": 2 * pi / 60},
    "m": {"m": 1.0, "mm": 1e-3},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3},
    "m/s^2": {"m/s^2": 1.0, "g": STANDARD_GRAVITY},
    "N m": {"N·m": 1.0, "N m": 1.0, "N mm": 1e-3},
    "N": {"N": 1.0},
    "V": {"V": 1.0},
}
"""Of each SI unit those of the same quantity, and their size in it."""
KNOWN_UNITS: Final = MappingProxyType[str, Unit](
    {name: Unit(factor, si) for si, units in _FACTORS.items() for name, factor in units.items()}
)


def to_si(values: Array, unit: str) -> Array:
    """Convert values of any shape, in one of `KNOWN_UNITS`, to the SI unit of their quantity."""
    return values * known_unit(unit).factor


def known_unit(unit: str) -> Unit:
    """Look up a unit by its name, one of `KNOWN_UNITS`; the message on any other offers the nearest."""
    if unit in KNOWN_UNITS:
        return KNOWN_UNITS[unit]
    nearest = [repr(name) for name in get_close_matches(unit, KNOWN_UNITS, n=2, cutoff=0.4)]
    hint = f"did you mean {' or '.join(nearest)}?" if nearest else f"known units: {', '.join(KNOWN_UNITS)}"
    raise InputError(f"unknown unit {unit!r}: {hint}")
