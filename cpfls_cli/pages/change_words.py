"""Changes of a vehicle in words: what changed, by how much in units that people use, and what to look at by hand."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from cpfls_cli.report.numbers import number
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import joined

Size = tuple[float, float, float]
"""A value with the ends of its interval, in the unit of the cause."""

Sizes = Sequence[Size]

_NAMES = {
    "mass": "another weight",
    "centre of mass": "a centre of mass elsewhere",
    "hover": "another thrust in hover",
    "all motors": "the speeds of all rotors",
    "torque about z": "a torque about z",
    "late": "another delay of the body",
    "answer": "another delay of the rotors",
    "gusts": "gusts",
    "lean": "steady wind or a tilted sensor",
    "drift": "an offset of the gyroscope",
    "unbalance": "another balance of rotors",
    "battery sag": "another battery",
}
"""What a cause is, where its key does not say it."""

_HEAVY = 1000.0
"""Grams that are told in kg."""

_CHECKS = {
    "rotor": "look at its propeller for cuts, chips, bends and what hangs near it; try a new one; turn the motor",
    "rotors": "look at both propellers for cuts, chips or bends; change them for new ones; turn the motors by hand",
    "weight": "see what is fixed there, and look at the propeller there: in hover both look nearly alike",
    "load": "see what hangs under it",
    "unbalance": "clean and balance its propeller; see that it sits straight; feel the bell of the motor for play",
    "mass": "weigh it, with battery and load",
    "centre of mass": "see where the battery sits, and what else can be put elsewhere",
    "hover": "weigh it; see whether all propellers are of the usual kind; charge the battery",
    "torque about z": "see whether a motor stands askew: its screws, its arm, a twisted frame",
    "vibration": "balance the propellers; tighten the screws of motors and autopilot; look for tape and chips",
    "turn": "turn the motor by hand: its bearing, its cable, its speed controller",
    "all": "charge the battery; see whether speed controllers or their settings were changed",
    "answer": "see whether speed controllers, their settings or the propellers were changed",
    "felt": "calibrate the accelerometer, and see how the autopilot is mounted",
    "follow": "see whether something sits further out or in than before, and whether all propellers are of one kind",
    "late": "see whether filters, speed controllers or the autopilot's settings were changed",
    "gusts": "fly again in still air; if it stays, look for what is loose",
    "lean": "fly again in still air; if it stays, calibrate the level, and see how the autopilot is mounted",
    "drift": "calibrate the gyroscope, warm and at rest",
    "scale": "see whether the gyroscope's range, its firmware or what estimates the attitude was changed",
    "battery": "charge and balance the battery, or take another; feel its contacts for heat",
}
"""What to look at, by cause or its first word."""


def cause_name(cause: str) -> str:
    """Name a change without its size."""
    kind, _, of = cause.partition(" ")
    if kind == "turn":
        return f"the speed of rotor {of}"
    if kind == "weight":
        return f"a {cause}"
    if kind == "felt":
        return f"an offset of the accelerometer along {of}"
    if kind == "scale":
        return f"another scale of the gyroscope about {of}"
    if kind == "unbalance" and of:
        return f"another balance of rotor {of}"
    if kind == "follow":
        return f"{of} that follows otherwise"
    return _NAMES.get(cause, cause)


_MEANS = {
    "load": "thrust that a rotor is asked for over its share of the weight",
    "turn": "squared speed of a rotor over what it is commanded",
    "answer": "time by which a rotor's speed follows its command",
    "vibration": "root mean square above 20 Hz",
    "unbalance": "acceleration that turns with a rotor",
    "follow": "angular acceleration over that of the rotors' torque",
    "late": "time by which the rotation follows the rotors",
    "gusts": "angular acceleration that the rotors do not explain",
    "lean": "mean horizontal thrust over mass",
    "felt": "mean of the accelerometer, along z less gravity",
    "drift": "mean rate of the gyroscope beside that of the attitude",
    "swing": "mass on a cable over that of the vehicle",
    "battery": "voltage that flight draws from the battery",
    "scale": "rate of the gyroscope over that of the attitude",
}
"""What a number is, by the first word of its name."""


def number_meanings(names: Iterable[str]) -> str:
    """Define the kinds of numbers that a table lists, each once."""
    kinds = dict.fromkeys(name.split()[0] for name in names)
    return "; ".join(f"{kind}: {_MEANS[kind]}" for kind in kinds if kind in _MEANS)


def what_to_check(cause: str) -> str:
    """Say what to look at by hand."""
    return _CHECKS.get(cause, _CHECKS.get(cause.split()[0], "look at the numbers that changed"))


def change_words(
    cause: str, sizes: Sizes, vehicle: VehicleSettings, axes: Sequence[str] = (), cable: float = math.nan
) -> str:
    """Say what changed and by how much.

    Parameters
    ----------
    axes : sequence of str
        Of a cause that has a size along several.
    cable : float
        Length of that of a load, m.
    """
    kind, _, of = cause.partition(" ")
    size, weight = sizes[0], _weight(vehicle, sizes[0][0])
    words = {
        "rotor": lambda: f"rotor {of} pulls {_percent(size, ('less', 'more'))}",
        "rotors": lambda: f"rotors {of} pull {joined(_percent(each, ('less', 'more')) for each in sizes)}",
        "mass": lambda: f"it is {_amount(size, *weight, ('heavier', 'lighter'))}",
        "load": lambda: (
            f"{_amount(size, 1e3 * vehicle.mass_kg, ' g')} hang under it on a cable of {number(cable, 2)} m"
        ),
        "weight": lambda: f"{_amount(size, *weight)} are fixed {of}",
        "hover": lambda: f"hover needs {_percent(size, ('more', 'less'))} thrust: {_either(vehicle, size[0])}",
        "all": lambda: f"all rotors turn {_percent(_less_one(0.5, size), ('faster', 'slower'))} than they are told",
        "centre": lambda: f"the centre of mass lies {_off_centre(sizes)}",
        "torque": lambda: f"a torque about z takes {_percent(size)} of the rotors' drag",
        "vibration": lambda: f"it vibrates {_times(size)}",
        "unbalance": lambda: f"what turns with {f'rotor {of}' if of else 'the rotors'} shakes it {_times(size)}",
        "turn": lambda: f"rotor {of} turns {_percent(_less_one(0.5, size), ('faster', 'slower'))} than it is told",
        "follow": lambda: f"{of} follows the rotors' torque {_percent(_less_one(1.0, size), ('more', 'less'))}",
        "late": lambda: f"rotation follows the rotors {_amount(size, 1e3, ' ms', ('later', 'earlier'))}",
        "answer": lambda: f"rotors follow their commands {_amount(size, 1e3, ' ms', ('later', 'earlier'))}",
        "felt": lambda: f"the accelerometer reads {_amount(size, 1.0, ' m/s²', ('more', 'less'))} along {of}",
        "gusts": lambda: f"what turns it beside the rotors, gusts, is {_times(size)}",
        "lean": lambda: f"it leans with {_each(sizes, axes, 'm/s²', 'along')} of the world, as against wind",
        "drift": lambda: f"the gyroscope is off by {_each(sizes, axes, 'rad/s', 'about')}",
        "scale": lambda: (
            f"the gyroscope reads {_percent(_less_one(1.0, size), ('more', 'less'))} about {of} beside the attitude"
        ),
        "battery": lambda: f"the battery falls {_percent(size, ('further', 'less far'))}",
    }
    return words[kind]() if kind in words else f"{cause}: {number(size[0], 2)}"


def smallest_words(cause: str, size: float, vehicle: VehicleSettings) -> str:
    """Say how large a change is that would have shown."""
    kind, _, of = cause.partition(" ")
    weight = weight_words(vehicle, size)
    words = {
        "rotor": f"a rotor that pulls {number(100 * size, 2)} % less",
        "rotors": f"two rotors that pull {number(100 * size, 2)} % less",
        "mass": weight,
        "load": f"{weight} on a cable",
        "unbalance": f"{number(math.exp(size), 2)} times the unbalance of {f'rotor {of}' if of else 'rotors'}",
        "weight": f"{weight} {of}",
        "hover": f"{number(100 * size, 2)} % of the thrust in hover",
        "all": f"{number(50 * size, 2)} % of the speed of all rotors",
        "centre": f"{number(1e3 * size, 2)} mm of the centre of mass",
        "torque": f"{number(100 * size, 2)} % of the rotors' drag in yaw",
        "vibration": f"{number(math.exp(size), 2)} times the vibration",
        "turn": f"{number(50 * size, 2)} % of the speed of rotor {of}",
        "follow": f"{number(100 * math.expm1(size), 2)} % of {of} for the same torque",
        "late": f"{number(1e3 * size, 2)} ms of delay",
        "answer": f"{number(1e3 * size, 2)} ms of the rotors' delay",
        "felt": f"{number(size, 2)} m/s² of the accelerometer along {of}",
        "gusts": f"{number(math.exp(size), 2)} times the gusts",
        "lean": f"{number(size, 2)} m/s² of steady wind or a tilted sensor",
        "drift": f"{number(size, 2)} rad/s of the gyroscope",
        "scale": f"{number(100 * math.expm1(size), 2)} % of the gyroscope's scale about {of}",
        "battery": f"{number(100 * size, 2)} % of a full battery",
    }
    return words.get(kind, f"{cause}: {number(size, 2)}")


def _either(vehicle: VehicleSettings, share: float) -> str:
    """Say what it can be that hover needs another thrust."""
    more = share > 0
    weight = weight_words(vehicle, share)
    return f"{weight} {'heavier' if more else 'lighter'}, or all rotors pull {'less' if more else 'more'}"


def hover_words(vehicle: VehicleSettings, share: float, *, alone: bool) -> str:
    """Say what hover needs, and where that is all that is known what it can be."""
    needs = f"needs {number(100 * abs(share), 2)} % {'more' if share > 0 else 'less'} thrust"
    return f"{needs}: {_either(vehicle, share)}" if alone else f"{needs} than in the reference"


def weight_words(vehicle: VehicleSettings, share: float) -> str:
    """Write a share of the mass in g or kg."""
    scale, unit = _weight(vehicle, share)
    return f"{number(abs(scale * share), 2)}{unit}"


def _weight(vehicle: VehicleSettings, share: float) -> tuple[float, str]:
    """Give the mass in g, or in kg where the share of it is that large."""
    grams = 1e3 * vehicle.mass_kg
    return (vehicle.mass_kg, " kg") if abs(grams * share) >= _HEAVY else (grams, " g")


def _off_centre(sizes: Sizes) -> str:
    ways = (("to the front", "to the back"), ("to the left", "to the right"))
    shown = [_amount(size, 1e3, " mm", way) for size, way in zip(sizes, ways, strict=True) if _is_clear(size)]
    return joined(shown) if shown else "elsewhere, by too little to say where"


def _each(sizes: Sizes, axes: Sequence[str], unit: str, before: str) -> str:
    shown = [f"{number(size[0], 2)} {unit} {before} {axis}" for size, axis in zip(sizes, axes, strict=False)]
    clear = [each for each, size in zip(shown, sizes, strict=False) if _is_clear(size)]
    return joined(clear or shown)


def _is_clear(size: Size) -> bool:
    return size[1] * size[2] > 0


def _percent(size: Size, ways: tuple[str, str] = ("", "")) -> str:
    return _amount(size, 100.0, " %", ways)


def _amount(size: Size, scale: float, unit: str, ways: tuple[str, str] = ("", "")) -> str:
    """Write how much a size is, which way, and its interval turned alike."""
    value, low, high = (scale * each for each in size)
    if value < 0:
        value, low, high = -value, -high, -low
    way = ways[0] if size[0] > 0 else ways[1]
    return f"{number(value, 2)}{unit}{' ' if way else ''}{way} ({number(low, 2)} to {number(high, 2)}{unit})"


def _less_one(power: float, size: Size) -> Size:
    """Turn logarithms into ratios to a power, less 1."""
    value, low, high = (math.expm1(power * each) for each in size)
    return value, low, high


def _times(size: Size) -> str:
    value, low, high = map(math.exp, size)
    return f"{number(value, 2)} times as strong ({number(low, 2)} to {number(high, 2)})"
