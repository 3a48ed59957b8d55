"""Numbers that no multirotor has: one table of limits, and the unit in which a number beyond them was likely meant.

The limits are those of multirotors from 25 g to 25 kg, widened to what any that flew has had, so that what lies beyond
is an error and no matter of judgement. What only lies beyond what is usual, or contradicts a flight, is for the check
of logs to say.
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import product
from math import inf, isnan, log, nan, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.units import RPM, STANDARD_GRAVITY

Figures = Mapping[str, float]
"""Numbers of a vehicle in SI by the names of `_QUANTITIES`, NaN for what is not known; ``room`` is `room_between` its
hubs, ``rotors`` their number, ``least_inertia`` and ``inertia`` are its extreme principal moments."""

_AIR_KG_M3 = 1.2
_EARTH = (9.0, 10.5)
"""Gravity where the air is that of the Earth, m/s^2."""

_ABOVE = 0.2
"""Share of the distance of the farthest hubs below which two, seen from above, are one above the other."""

_MOST_UNITS = 3
"""Numbers that are taken to be in a wrong unit at once; each counts as much as a number at the end of what is usual."""

_CLOSE, _MOST_READINGS = 1.0, 3
"""How much less likely another reading may be to be listed too, and how many are."""


class Limit(NamedTuple):
    """A number that follows from those of a vehicle.

    Attributes
    ----------
    what, unit : str
        What it is called.
    of : tuple of str
        Numbers that make it, by the names of `_QUANTITIES`.
    formula : callable
        Gives it from what is known.
    possible : tuple of float
        Beyond which it is none of a vehicle.
    usual : tuple of float
        Of multirotors from 25 g to 25 kg.
    """

    what: str
    unit: str
    of: tuple[str, ...]
    formula: Callable[[Figures], float]
    possible: tuple[float, float]
    usual: tuple[float, float]

    def value(self, figures: Figures) -> float:
        """Compute it for a vehicle, NaN where it is not known."""
        if any(isnan(figures[name]) for name in self.of):
            return nan
        try:
            return self.formula(figures)
        except ArithmeticError:
            return inf

    def allows(self, value: float) -> bool:
        """Tell whether a vehicle may have it; what is not known it may have."""
        return not (value < self.possible[0] or value > self.possible[1])

    def unusual(self, figures: Figures) -> float:
        """Square how far it is from the middle of what is usual, 1 at either end, by ratios; 0 where not known."""
        value, (least, most) = self.value(figures), self.usual
        return 0.0 if isnan(value) else (log(value**2 / (least * most)) / log(most / least)) ** 2


def room(arm_m: float, rotors: int) -> float:
    """Give the diameter of propellers at the ends of arms whose neighbours touch, m."""
    return 2 * arm_m * sin(pi / rotors)


def room_between(hubs: Array) -> float:
    """Give the diameter, m, of propellers between such hubs, shape (rotor, 3), that touch; NaN for hubs in one place.

    Of rotors above each other the neighbours at their sides count.
    """
    with np.errstate(over="ignore"):
        apart = np.linalg.norm(hubs[:, None, :2] - hubs[:, :2], axis=2)
    neighbours = apart[apart > _ABOVE * apart.max()]
    return float(neighbours.min()) if len(neighbours) else nan


def thrust_number(mass_kg: float, diameter_m: float, speed: Array) -> float:
    """Give the thrust number ``T / (rho n^2 D^4)`` of rotors that carry a mass, were they of such a diameter.

    Parameters
    ----------
    speed : array, shape (time, rotor), rad/s
    """
    return _thrust_number(mass_kg * STANDARD_GRAVITY / float((speed**2).mean(axis=0).sum()), diameter_m)


def _thrust_number(thrust_factor: float, diameter: float) -> float:
    return 4 * pi**2 * thrust_factor / (_AIR_KG_M3 * diameter**4)


def _weight(f: Figures) -> float:
    return f["mass"] * f["gravity"]


def _hover_speed(f: Figures) -> float:
    return sqrt(_weight(f) / (f["rotors"] * f["thrust_factor"]))


def _on_earth(f: Figures) -> float:
    return 1.0 if _EARTH[0] < f["gravity"] < _EARTH[1] else nan


IN_ROOM = Limit(
    "thrust number of propellers that fit between the hubs",
    "",
    ("thrust_factor", "arm"),
    lambda f: _on_earth(f) * _thrust_number(f["thrust_factor"], f["room"]),
    # Propellers of 0.05 that fill a third of the room, and of 0.2 that overlap by half.
    (0.00075, 1.0),
    (0.003, 0.2),
)
LIMITS = (
    # From a quadrotor of 3 g to air taxis (Volocopter 2X 450 kg, EHang 216 620 kg).
    Limit("mass", "kg", ("mass",), lambda f: f["mass"], (0.001, 5000.0), (0.025, 25.0)),
    # The widest that flew by the force of a human being has hubs 18 m from its middle (Atlas 2013).
    Limit("arm", "m", ("arm",), lambda f: f["arm"], (0.005, 20.0), (0.03, 0.8)),
    # From the Moon to Jupiter.
    Limit("gravity", "m/s^2", ("gravity",), lambda f: f["gravity"], (1.0, 30.0), (9.78, 9.83)),
    # Atlas has 1 N/m^2; ducted fans and tiltrotors have 1000 to 3000, of their own disc, which is less than the room.
    Limit(
        "disc loading between its hubs",
        "N/m^2",
        ("mass", "arm"),
        lambda f: _weight(f) / (f["rotors"] * pi / 4 * f["room"] ** 2),
        (0.3, 3000.0),
        (10.0, 300.0),
    ),
    # Published multirotors have 0.3 to 1.5 arms about the axes of the body.
    Limit(
        "largest radius of gyration in arms",
        "",
        ("inertia", "mass", "arm"),
        lambda f: sqrt(f["inertia"] / f["mass"]) / f["arm"],
        (0.03, 10.0),
        (0.3, 1.5),
    ),
    Limit(
        "least radius of gyration in arms",
        "",
        ("inertia", "mass", "arm"),
        lambda f: sqrt(f["least_inertia"] / f["mass"]) / f["arm"],
        (0.03, 10.0),
        (0.3, 1.0),
    ),
    IN_ROOM,
    # Propellers have 0.05 to 0.2 at rest, by the data of Brandt and Selig 2011.
    Limit(
        "thrust number of its propellers",
        "",
        ("thrust_factor", "radius"),
        lambda f: _on_earth(f) * _thrust_number(f["thrust_factor"], 2 * f["radius"]),
        (0.005, 2.0),
        (0.05, 0.2),
    ),
    Limit(
        "diameter of its propellers in distances of the nearest hubs",
        "",
        ("radius", "arm"),
        lambda f: 2 * f["radius"] / f["room"],
        (0.05, 3.0),
        (0.5, 1.0),
    ),
    # No propeller is as fast as sound at its tip while it hovers; a limit of speeds is stated with room.
    Limit(
        "speed of the tips in hover",
        "m/s",
        ("radius", "thrust_factor", "mass"),
        lambda f: _hover_speed(f) * f["radius"],
        (2.0, 400.0),
        (30.0, 120.0),
    ),
    Limit(
        "largest speed of the tips",
        "m/s",
        ("speed_max", "radius"),
        lambda f: f["speed_max"] * f["radius"],
        (10.0, 800.0),
        (50.0, 250.0),
    ),
    # A vehicle that carries less than its weight does not fly; a limit that is never reached makes the ratio large.
    Limit(
        "largest thrust over weight",
        "",
        ("thrust_factor", "speed_max", "mass"),
        lambda f: f["rotors"] * f["thrust_factor"] * f["speed_max"] ** 2 / _weight(f),
        (0.15, 2000.0),
        (1.5, 15.0),
    ),
    # The ratio is 0.1 to 0.2 of a propeller's radius.
    Limit(
        "drag over thrust factor in arms",
        "",
        ("drag_factor", "thrust_factor", "arm"),
        lambda f: f["drag_factor"] / f["thrust_factor"] / f["arm"],
        (0.003, 5.0),
        (0.03, 0.8),
    ),
)
"""What every vehicle keeps to."""


class _Quantity(NamedTuple):
    """A number that a person states: what it is, the unit that is asked for, and those taken by mistake, in SI."""

    words: str
    unit: str
    units: Mapping[str, float]


_LENGTHS = {"mm": 1e-3, "cm": 1e-2, "inches": 0.0254}
_QUANTITIES: Mapping[str, _Quantity] = {
    "mass": _Quantity("a mass", "kg", {"g": 1e-3}),
    "arm": _Quantity("an arm", "m", _LENGTHS),
    "radius": _Quantity("a radius", "m", _LENGTHS),
    "inertia": _Quantity("an inertia", "kg m^2", {"kg cm^2": 1e-4, "g m^2": 1e-3, "kg mm^2": 1e-6, "g cm^2": 1e-7}),
    "thrust_factor": _Quantity("a factor", "N s^2", {"N/rpm^2": RPM**2}),
    "drag_factor": _Quantity("a factor", "N m s^2", {"N m/rpm^2": RPM**2}),
    "speed_max": _Quantity("a speed", "rad/s", {"rpm": 1 / RPM}),
    "gravity": _Quantity("an acceleration", "m/s^2", {}),
}


class Beyond(NamedTuple):
    """A number that no vehicle has.

    Attributes
    ----------
    name : str
        Of `_QUANTITIES`.
    why : str
        What follows from it that no vehicle has, and in which unit it was likely meant.
    """

    name: str
    why: str


def figures_of(gravity: float = STANDARD_GRAVITY, **known: float) -> dict[str, float]:
    """Arrange numbers of a vehicle, by the names of `Figures`; those that are left out are not known."""
    return {**dict.fromkeys((*_QUANTITIES, "least_inertia", "room", "rotors"), nan), "gravity": gravity, **known}


def figures_of_hubs(hubs: Array) -> dict[str, float]:
    """Give the numbers that places of rotors show, shape (rotor, 3), m; rotors in one place show no size."""
    with np.errstate(over="ignore"):
        arm = float(np.linalg.norm(hubs, axis=1).max())
    return {"arm": arm or nan, "room": room_between(hubs), "rotors": float(len(hubs))}


def beyond_any_vehicle(figures: Figures) -> tuple[Beyond, ...]:
    """Find numbers that no vehicle has, in the fewest wrong units that explain them."""
    broken = list(broken_limits(figures))
    if not broken:
        return ()
    readings = _readings(figures)
    if not readings:
        first = {limit.of[0]: limit for limit in reversed(broken)}
        return tuple(Beyond(name, f"{_stated(limit, figures)}{_look(limit)}") for name, limit in first.items())
    best, *others = readings
    found = [_in_another_unit(figures, name, best) for name in best]
    also = "".join(f"; or {_in_words(figures, units)}" for units in others[:_MOST_READINGS])
    return (*found[:-1], found[-1]._replace(why=f"{found[-1].why}{also}"))


def broken_limits(figures: Figures) -> Iterator[Limit]:
    """List the limits that a vehicle of these numbers is beyond."""
    return (limit for limit in LIMITS if not limit.allows(limit.value(figures)))


def _readings(figures: Figures) -> list[dict[str, str]]:
    """List the units in which all is possible: few of them and usual results first, and what comes close to that."""
    choices = [[(name, unit) for unit in ("", *quantity.units)] for name, quantity in _QUANTITIES.items()]
    tried = []
    for each in product(*choices):
        changed = {name: unit for name, unit in each if unit}
        if not changed or len(changed) > _MOST_UNITS or any(isnan(figures[name]) for name in changed):
            continue
        read = _read(figures, changed)
        if not any(True for _ in broken_limits(read)):
            tried.append((len(changed) + sum(limit.unusual(read) for limit in LIMITS), changed))
    tried.sort(key=lambda one: one[0])
    return [units for cost, units in tried if cost < tried[0][0] + _CLOSE]


def _read(figures: Figures, changed: Mapping[str, str]) -> dict[str, float]:
    read = dict(figures)
    for name, unit in changed.items():
        for own in {"arm": ("arm", "room"), "inertia": ("inertia", "least_inertia")}.get(name, (name,)):
            read[own] *= _QUANTITIES[name].units[unit]
    return read


def _stated(limit: Limit, figures: Figures) -> str:
    value, unit = limit.value(figures), f" {limit.unit}" if limit.unit else ""
    bound = f"less than {limit.possible[0]:g}" if value < limit.possible[0] else f"more than {limit.possible[1]:g}"
    return f"the {limit.what} is {value:.3g}{unit}, and no vehicle has {bound}"


def _look(limit: Limit) -> str:
    return "; check its unit and those of what it is compared with" if len(limit.of) > 1 else "; check its unit"


def _in_another_unit(figures: Figures, name: str, best: Mapping[str, str]) -> Beyond:
    """Say what is impossible about a number once the others are read rightly, and what it was likely meant to be."""
    unit, others = best[name], {other: own for other, own in best.items() if other != name}
    read = _read(figures, others)
    concerned = next((limit for limit in broken_limits(read) if name in limit.of), None)
    given = "with the others right, " if concerned is None or others.keys() & {*concerned.of} else ""
    stated = "" if concerned is None else f"{_stated(concerned, read)}: "
    quantity, value = _QUANTITIES[name], figures[name]
    meant = f"{value * quantity.units[unit]:.4g} {quantity.unit}? {value:.4g} is {quantity.words} in {unit}"
    return Beyond(name, f"{given}{stated}{meant}")


def _in_words(figures: Figures, units: Mapping[str, str]) -> str:
    return " and ".join(f"{figures[name]:.4g} is {_QUANTITIES[name].words} in {unit}" for name, unit in units.items())
