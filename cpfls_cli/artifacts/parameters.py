"""What flights tell of the constants of a vehicle, by the keys of a config: values, intervals, and what stays open."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.spec import rows_of
from cpfls_cli.effects.registry import CENTRE_OF_MASS
from cpfls_cli.inertia import INERTIA_PARAMETERS, MEASURED, beyond_any_body, more_than_others, symmetric

if TYPE_CHECKING:
    from cpfls_cli.artifacts.vehicle_model import VehicleRecord

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

THRUST_LAW = "thrust_law.linear"
"""Number of a fit beside which the thrust factor is that of thrust."""

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
        None: no flight and no config tells it.
    low, high : float or None
        95 % interval of what was found.
    stated : float or None
        In the config.
    determined : bool
        Whether the flights tell it.
    possible : bool
        Whether such a vehicle can have it.
    reason : str
        Why, or why not.
    """

    key: str
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
    def told(self) -> str:
        """Whether the flights tell it, in a word."""
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
    def needed(self) -> bool:
        """Whether it is anything but a zero that nobody asked for."""
        return self.value != 0 or self.low is not None or self.stated is not None


def parameters_of(record: VehicleRecord) -> Iterator[Parameter]:
    """List the constants of a vehicle that was found, known or not."""
    found = {row["name"]: row for row in rows_of(record.found)}
    guesses = {key for name in record.guess or () for key in GUESSES[name]}
    for key, name in FOUND_AS.items():
        unit = _UNITS.get(key, "kg m^2")
        if name in found:
            row = found[name]
            stated = row["stated"] if np.isfinite(row["stated"]) else None
            ends, reason = (row["low"], row["high"]), _reason(record, row)
            why = reason or "found in flights"
            yield Parameter(key, row["value"], unit, *ends, stated, not reason, why, name not in record.impossible)
        elif key in guesses:
            reason = "not known: neither velocity nor accelerometer tells thrust from weight"
            yield Parameter(key, None, unit, None, None, None, False, reason)
        else:
            held = _held(record, key)
            stated = held if key in STATED and held else None
            yield Parameter(key, held, unit, None, None, stated, False, _why_not_fitted(key))


def _reason(record: VehicleRecord, row: dict[str, Any]) -> str:
    """Say why a number is not determined; empty where it is."""
    name = row["name"]
    if name not in record.untold:
        return ""
    if name in record.on_bound:
        return ON_BOUND
    others = [
        each["second"] if each["first"] == name else each["first"]
        for each in rows_of(record.trade)
        if name in (each["first"], each["second"])
    ]
    if record.loop.shown and record.instruments is None and name != FOUND_AS[THRUST]:
        return "these flights show the loop, not the vehicle"
    if record.loop.misses and record.instruments is None and name != FOUND_AS[THRUST]:
        return "what was found does not explain these flights"
    if name in OF_TURNING and too_heavy(record):
        return too_heavy(record)
    if name in excess(record):
        return f"{excess(record)[name]}: a number that predicts, not the body's"
    if name in record.impossible:
        return OF_NONE
    if others:
        return f"only its ratio to {' and '.join(others)} is known: they trade against each other"
    return "the flights say too little, the interval is too wide"


def too_heavy(record: VehicleRecord) -> str:
    """Say that the inertia that was found is that of no body; empty where it can be."""
    moments = {row["name"]: row["value"] for row in rows_of(record.found)}
    vehicle = record.vehicle
    limits = beyond_any_body(vehicle.mass, vehicle.rotor.position, moments)
    if not limits:
        return ""
    told = " and ".join(
        f"{name_of(name)} {moments[name]:.3g} where at most {limit:.3g} is possible" for name, limit in limits.items()
    )
    return (
        f"too heavy for {vehicle.mass:.3g} kg between these rotors ({told}, kg m^2): numbers that predict, not the "
        "body's"
    )


def excess(record: VehicleRecord) -> dict[str, str]:
    """Say of a moment of inertia that was found and is more than the other two together that no body has it."""
    moments = record.vehicle.inertia[:3]
    named = {f"inertia.{name}": float(moments[INERTIA_PARAMETERS.index(name)]) for name in more_than_others(moments)}
    return {
        name: f"no body has it, for the other two are {moments.sum() - moment:.3g} kg m^2 together"
        for name, moment in named.items()
        if name in record.found.name
    }


def _held(record: VehicleRecord, key: str) -> float:
    vehicle = record.vehicle
    if key in INERTIA:
        return float(vehicle.inertia[INERTIA.index(key)])
    of_rotors = {THRUST: vehicle.rotor.thrust_factor, DRAG: vehicle.rotor.drag_factor}
    if key in of_rotors:
        return float(np.mean(of_rotors[key]))
    return {LAG: vehicle.response.lag_s, DELAY: vehicle.response.delay_s}.get(key, 0.0)


def _why_not_fitted(key: str) -> str:
    if key in (LAG, DELAY, *CENTRE, *INERTIA[3:]):
        return "not needed: no lower error with it"
    return "as stated: no lower error with another"


def vehicle_section(record: VehicleRecord) -> dict[str, Any]:
    """Write the section `vehicle` of a config with what was found; null for what was not known and still is not."""
    known = {each.key: each for each in parameters_of(record)}
    vehicle, rotors = record.vehicle, record.vehicle.rotor

    def relied_on(key: str, held: float) -> float | None:
        # What the flights do not tell stays as it was stated, if it was.
        value = known[key].stated if _open(known[key]) else held
        return None if value is None else _rounded(value)

    # A product that is not known is none; a moment that is not known is to be found.
    inertia = [relied_on(key, vehicle.inertia[place]) for place, key in enumerate(INERTIA)]
    inertia[3:] = [value or 0.0 for value in inertia[3:]]
    if all(inertia[:3]) and not _of_a_body(np.array(inertia)):
        # Numbers that were found beside stated ones that do not go with them: those are to be found too.
        inertia[:3] = [
            value if known[key].determined else None for key, value in zip(INERTIA, inertia[:3], strict=False)
        ]
        inertia[:3] = [None] * 3 if all(inertia[:3]) else inertia[:3]
    section: dict[str, Any] = {
        "gravity_m_s2": vehicle.gravity,
        "mass_kg": _rounded(vehicle.mass),
        "inertia_kg_m2": inertia if all(inertia[:3]) and any(inertia[3:]) else inertia[:3],
        "rotors": [
            {
                "position_m": [_rounded(value) for value in rotors.position[place]],
                "spin": int(rotors.spin[place]),
                "thrust_factor_n_s2": relied_on(THRUST, rotors.thrust_factor[place]),
                "drag_factor_n_m_s2": relied_on(DRAG, rotors.drag_factor[place]),
                "radius_m": _rounded(rotors.radius[place]) if np.isfinite(rotors.radius[place]) else None,
            }
            for place in range(len(rotors.spin))
        ],
        "rotor_speed_max_rad_s": rotors.speed_max,
    }
    return section


def _of_a_body(inertia: Array) -> bool:
    """Tell whether no principal moment is more than the other two together, which a config refuses."""
    smallest, middle, largest = np.linalg.eigvalsh(symmetric(inertia))
    return bool(largest <= MEASURED * (smallest + middle))


def _open(parameter: Parameter) -> bool:
    """Tell whether a number that a fit was free to choose is not to be relied on."""
    return not parameter.determined and (parameter.low is not None or parameter.value is None)


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
