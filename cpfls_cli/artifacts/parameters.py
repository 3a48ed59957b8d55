"""Constants of a vehicle as flights identify them, by the keys of a config: values, intervals, and what stays open."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.registry import CENTRE_OF_MASS
from cpfls_cli.inertia import INERTIA_PARAMETERS, MEASURED, beyond_any_body, more_than_others, six_parameters, symmetric
from cpfls_cli.result import About

if TYPE_CHECKING:
    from cpfls_cli.artifacts.vehicle_model import Vehicle
    from cpfls_cli.playback.vehicle import FoundNumber

_DIGITS = 6
THRUST, DRAG = "rotors.thrust_factor_n_s2", "rotors.drag_factor_n_m_s2"
INERTIA = tuple(f"inertia_kg_m2.{place}" for place in range(6))
LAG, DELAY, CENTRE = "motor_lag_s", "delay_s", ("com_m.0", "com_m.1")
FOUND_AS = {
    THRUST: "thrust_factor",
    DRAG: "drag_factor",
    **dict(zip(INERTIA[:3], (f"inertia.{name}" for name in INERTIA_PARAMETERS[:3]), strict=True)),
    **dict(zip(INERTIA[3:], (f"products.{name}" for name in INERTIA_PARAMETERS[3:]), strict=True)),
    LAG: "lag.time_constant_s",
    DELAY: "delay.delay_s",
    **dict(zip(CENTRE, (f"{CENTRE_OF_MASS.name}.{each.name}" for each in CENTRE_OF_MASS.coefficients), strict=True)),
}
"""Numbers of a fit, by the keys under which people look for them."""


_REMAINDER = "remainder"
_NAMES = {
    THRUST: "thrust factor",
    DRAG: "drag factor",
    **dict(zip(INERTIA, INERTIA_PARAMETERS, strict=True)),
    LAG: "lag of the rotors",
    DELAY: "delay",
    **dict(zip(CENTRE, ("centre of mass along x", "along y"), strict=True)),
}

_FOUND_NAMES = {found: _NAMES[key] for key, found in FOUND_AS.items()}

OF_TURNING = frozenset(FOUND_AS[key] for key in (DRAG, *INERTIA))
"""Numbers of a fit that are known only as far as the torques are that turn the vehicle."""

_UNITS = {THRUST: "N s^2", DRAG: "N m s^2", LAG: "s", DELAY: "s", **dict.fromkeys(CENTRE, "m")}
ON_BOUND = "at the limit of the search"
OF_NONE = "impossible for such a vehicle; it fits these flights, but is not a constant of the vehicle"

STATED = (THRUST, DRAG, *INERTIA)
"""What a config states, where it states anything."""

GUESSES = {"thrust_factor": (THRUST,), "drag_factor": (DRAG,), "inertia": INERTIA[:3]}


def name_of(found: str) -> str:
    """Say what people call a number of a fit."""
    block, _, number = found.partition(".")
    return _FOUND_NAMES.get(found, f"{block.replace('_', ' ')} {number}".strip())


def is_learned(found: str) -> bool:
    """Tell whether a number of a fit belongs to a remainder: to that of the torque, or of the force."""
    return found.startswith(_REMAINDER)


class Parameter(NamedTuple):
    """A constant of a vehicle.

    Attributes
    ----------
    key : str
        Below the section `vehicle` of a config, where that has it.
    value : float or None
        None: no flight identifies it, and no config states it.
    low, high : float or None
        95 % interval of what was found.
    stated : float or None
        In the config.
    determined : bool
        Whether the flights identify it.
    possible : bool
        Whether such a vehicle can have it.
    reason : str
        Why, or why not.
    """

    key: Annotated[str, About("below the section `vehicle` of a config", brief=False)]
    value: float | None
    unit: str
    low: float | None
    high: float | None
    stated: float | None
    determined: bool
    reason: str
    possible: bool = True

    @property
    def name(self) -> str:
        """What people call it."""
        return _NAMES[self.key]

    @property
    def identified(self) -> str:
        """Whether the flights identify it, in a word."""
        if self.determined:
            return "yes"
        if self.value is None:
            return "a guess"
        if self.low is None:
            return "as in the config" if self.stated is not None else "not needed"
        if not self.possible:
            return "no: impossible"
        return f"no: {ON_BOUND}" if self.reason == ON_BOUND else "no"

    @property
    def wanting(self) -> bool:
        """Whether it was looked for and not found."""
        return self.value is None or (self.low is not None and not self.determined)

    @property
    def needed(self) -> bool:
        """Whether it is anything but a zero that nobody asked for."""
        return self.value != 0 or self.low is not None or self.stated is not None


def parameters_of(vehicle: Vehicle) -> Iterator[Parameter]:
    """List the constants of a vehicle that was found, known or not."""
    guesses = {key for name in vehicle.guessed for key in GUESSES[name]}
    for key, name in FOUND_AS.items():
        unit = _UNITS.get(key, "kg m^2")
        if name in vehicle.found:
            number = vehicle.found[name]
            stated = number.stated if np.isfinite(number.stated) else None
            reason, possible = _reason(vehicle, number), name not in vehicle.impossible
            why = reason or "found in flights"
            yield Parameter(key, number.value, unit, number.low, number.high, stated, not reason, why, possible)
        elif key in guesses:
            reason = "not known: neither velocity nor accelerometer separates thrust from weight"
            yield Parameter(key, None, unit, None, None, None, False, reason)
        else:
            held = _held(vehicle, key)
            stated = held if key in STATED and held else None
            yield Parameter(key, held, unit, None, None, stated, False, _why_not_fitted(key))


def _reason(vehicle: Vehicle, number: FoundNumber) -> str:
    """Say why a number is not determined; empty where it is."""
    name, alone = number.name, vehicle.instruments is None and number.name != FOUND_AS[THRUST]
    if name not in vehicle.not_determined:
        return ""
    if name in vehicle.on_bound:
        return ON_BOUND
    if vehicle.loop.shows_loop and alone:
        return "these flights show the loop, not the vehicle"
    if vehicle.loop.misses and alone:
        return "what was found does not explain these flights"
    if name in OF_TURNING and too_heavy(vehicle):
        return too_heavy(vehicle)
    if name in excess(vehicle):
        return f"{excess(vehicle)[name]}: a number that predicts, not the body's"
    if name in vehicle.impossible:
        return OF_NONE
    pairs = [(trade.first, trade.second) for trade in vehicle.trades]
    others = [second if first == name else first for first, second in pairs if name in (first, second)]
    if others:
        return f"only its ratio to {' and '.join(others)} is known: they trade against each other"
    return "the flights say too little, the interval is too wide"


def too_heavy(vehicle: Vehicle) -> str:
    """Say that the inertia that was found is that of no body; empty where it can be."""
    moments = {number.name: number.value for number in vehicle.numbers}
    stated = vehicle.model.vehicle
    limits = beyond_any_body(stated.mass_kg, np.array([rotor.position_m for rotor in stated.rotors]), moments)
    if not limits:
        return ""
    beyond = " and ".join(
        f"{name_of(name)} {moments[name]:.3g} where at most {limit:.3g} is possible" for name, limit in limits.items()
    )
    return (
        f"too heavy for {stated.mass_kg:.3g} kg between these rotors ({beyond}, kg m^2): numbers that predict, not the "
        "body's"
    )


def excess(vehicle: Vehicle) -> dict[str, str]:
    """Say of a moment of inertia that was found and is more than the other two together that no body has it."""
    moments = np.array(vehicle.model.vehicle.inertia_kg_m2[:3])
    named = {f"inertia.{name}": float(moments[INERTIA_PARAMETERS.index(name)]) for name in more_than_others(moments)}
    return {
        name: f"no body has it, for the other two are {moments.sum() - moment:.3g} kg m^2 together"
        for name, moment in named.items()
        if name in vehicle.found
    }


def _held(vehicle: Vehicle, key: str) -> float:
    stated, response = vehicle.model.vehicle, vehicle.model.response
    if key in INERTIA:
        return float(six_parameters(stated.inertia_kg_m2)[INERTIA.index(key)])
    if key in (THRUST, DRAG):
        return float(np.mean([getattr(rotor, key.rpartition(".")[2]) for rotor in stated.rotors]))
    return {LAG: response.lag_s, DELAY: response.delay_s}.get(key, 0.0)


def _why_not_fitted(key: str) -> str:
    if key in (LAG, DELAY, *CENTRE, *INERTIA[3:]):
        return "not needed: no lower error with it"
    return "as stated: no lower error with another"


def vehicle_section(vehicle: Vehicle) -> dict[str, Any]:
    """Write the section `vehicle` of a config with what was found; null for what was not known and still is not."""
    known, stated = vehicle.parameters, vehicle.model.vehicle

    def relied_on(key: str, held: float) -> float | None:
        # What the flights do not identify stays as it was stated, if it was.
        value = known[key].stated if _open(known[key]) else held
        return None if value is None else _rounded(value)

    # A product that is not known is none; a moment that is not known is to be found.
    inertia = [relied_on(key, held) for key, held in zip(INERTIA, six_parameters(stated.inertia_kg_m2), strict=True)]
    inertia[3:] = [value or 0.0 for value in inertia[3:]]
    if all(inertia[:3]) and not _of_a_body(np.array(inertia)):
        # Numbers that were found with stated ones that do not go with them: those are to be found too.
        inertia[:3] = [
            value if known[key].determined else None for key, value in zip(INERTIA, inertia[:3], strict=False)
        ]
        inertia[:3] = [None] * 3 if all(inertia[:3]) else inertia[:3]
    return {
        "gravity_m_s2": stated.gravity_m_s2,
        "mass_kg": _rounded(stated.mass_kg),
        "inertia_kg_m2": inertia if all(inertia[:3]) and any(inertia[3:]) else inertia[:3],
        "rotors": [
            {
                "position_m": [_rounded(value) for value in rotor.position_m],
                "spin": rotor.spin,
                "thrust_factor_n_s2": relied_on(THRUST, rotor.thrust_factor_n_s2),
                "drag_factor_n_m_s2": relied_on(DRAG, rotor.drag_factor_n_m_s2),
                "radius_m": None if rotor.radius_m is None else _rounded(rotor.radius_m),
            }
            for rotor in stated.rotors
        ],
        "rotor_speed_max_rad_s": stated.rotor_speed_max_rad_s,
    }


def _of_a_body(inertia: Array) -> bool:
    """Tell whether no principal moment is more than the other two together, which a config refuses."""
    smallest, middle, largest = np.linalg.eigvalsh(symmetric(inertia))
    return bool(largest <= MEASURED * (smallest + middle))


def _open(parameter: Parameter) -> bool:
    """Tell whether a number that a fit was free to choose is not to be relied on."""
    return not parameter.determined and (parameter.low is not None or parameter.value is None)


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
