"""What logs say of their vehicles, by which logs of two vehicles are told apart."""

from collections.abc import Mapping
from typing import Final

_GEOMETRY: Final = ("CA_ROTOR", "CA_AIRFRAME", "FRAME", "Q_FRAME", "SYS_AUTOSTART", "MAV_TYPE")
_NO_GEOMETRY: Final = ("_CT", "_SLEW")
"""Ends of names of what is tuned in flight."""

WRITTEN_BY: Final = "written by"
"""Name of the fact that says which autopilot wrote a log."""


def stated_vehicle(system: str, parameters: Mapping[str, float | str]) -> dict[str, str]:
    """List what a log says of its vehicle, as text by name: its autopilot, and parameters of its frame and rotors."""
    facts = {WRITTEN_BY: system.partition(" ")[0]}
    kept = (key for key in sorted(parameters) if key.startswith(_GEOMETRY) and not key.endswith(_NO_GEOMETRY))
    return facts | {key: plain(parameters[key]) for key in kept}


def plain(value: float | str) -> str:
    """Write the value of a parameter."""
    return value if isinstance(value, str) else f"{value:.6g}"


def vehicles_apart(first: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """Say in what two logs state different vehicles; empty where they do not, or one states nothing at all."""
    return [
        f"{key} {first[key] or 'something unknown'} and {other[key] or 'something unknown'}"
        for key in first
        if key in other and first[key] != other[key]
    ]
