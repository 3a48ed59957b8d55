"""What logs say of their vehicles, by which logs of two vehicles are told apart."""

from collections.abc import Mapping
from typing import Final

_GEOMETRY: Final = ("CA_ROTOR", "CA_AIRFRAME", "FRAME", "Q_FRAME", "SYS_AUTOSTART", "MAV_TYPE")
_NO_GEOMETRY: Final = ("_CT", "_SLEW")  # Ends of names of what is tuned in flight.
_OLD_FRAME, _FRAME = "FRAME", "FRAME_TYPE"  # Of ArduCopter before 3.5, with the same numbers.
# What besides belongs to a vehicle, as Betaflight, ArduPilot and PX4 call it.
_OTHERS: Final = ("Craft name", "motor_poles", "SERVO_BLH_POLES", "MOT_POLE_COUNT")
WRITTEN_BY: Final = "written by"  # Name of the fact that says which autopilot wrote a log.
_VERSION: Final = "version"
_BOARD: Final = ("Board information", "BRD_TYPE")
# Outputs that stop and full throttle stand for.
_RANGES: Final = ("motorOutput", "MOT_PWM_MIN", "MOT_PWM_MAX", "THR_MIN", "PWM_MIN", "PWM_MAX", "RC3_MIN", "RC3_MAX")
_OF_INPUT: Final = ("RC3_MIN", "RC3_MAX")  # Of the outputs too in ArduCopter, where MOT_PWM_MAX is 0 or not there.
# Share by which an end of a range differs that moves no load by more than flights of one vehicle differ.
_SAME_RANGE: Final = 0.002


def stated_vehicle(system: str, parameters: Mapping[str, float | str]) -> dict[str, str]:
    """List what a log says of its vehicle, as text by name: its autopilot, frame, rotors, board, range of outputs."""
    writer, _, version = system.partition(" ")
    own = dict(parameters)
    if _OLD_FRAME in own:
        own.setdefault(_FRAME, own.pop(_OLD_FRAME))
    ranges = [key for key in _RANGES if key not in _OF_INPUT or (writer == "ArduCopter" and not own.get("MOT_PWM_MAX"))]
    geometry = [key for key in sorted(own) if key.startswith(_GEOMETRY) and not key.endswith(_NO_GEOMETRY)]
    facts = {key: plain(own[key]) for key in (*geometry, *_OTHERS, *_BOARD, *ranges) if key in own}
    stated = {_VERSION: version} | facts
    return {WRITTEN_BY: writer} | {key: value for key, value in stated.items() if value.strip()}


def plain(value: float | str) -> str:
    """Write the value of a parameter."""
    return value if isinstance(value, str) else f"{value:.6g}"


def vehicles_apart(first: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """Say in what two logs state different vehicles; empty where they do not, or one states nothing at all."""
    return [words for key, words in _apart(first, other) if key not in (_VERSION, *_BOARD, *_RANGES)]


def autopilots_apart(first: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """Say in what two logs state another board, version or range of outputs, as one vehicle can have in turn."""
    return [words for key, words in _apart(first, other) if key in (_VERSION, *_BOARD, *_RANGES)]


def ranges_apart(first: Mapping[str, str], other: Mapping[str, str]) -> bool:
    """Tell whether two logs state other ranges of outputs, so that commands are other shares of all thrust."""
    return any(key in _RANGES for key, _ in _apart(first, other))


def _apart(first: Mapping[str, str], other: Mapping[str, str]) -> list[tuple[str, str]]:
    return [
        (key, f"{key} {first[key] or 'something unknown'} and {other[key] or 'something unknown'}")
        for key in first
        if key in other and first[key] != other[key] and not (key in _RANGES and _nearly(first[key], other[key]))
    ]


def _nearly(first: str, other: str) -> bool:
    one, two = ([float(part) for part in each.split(",")] for each in (first, other))
    return len(one) == len(two) and all(abs(a - b) <= _SAME_RANGE * abs(a) for a, b in zip(one, two, strict=True))
