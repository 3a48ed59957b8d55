"""Rotors, their thrust and numbers of the vehicle held against the motion and against what the config says of them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import pi
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.consistency.findings import Finding
from cpfls_cli.consistency.motion import PairCheck, by_thrust
from cpfls_cli.effects.catalogue.parameter_error import NUMBERS
from cpfls_cli.effects.signals import Signals
from cpfls_cli.flightlog.airframe import airframe_from_motion, place_of
from cpfls_cli.inertia import INERTIA_PARAMETERS, beyond_any_body
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle_limits import IN_ROOM, room_between, thrust_number

_THRUST_TO_WEIGHT = 5.0
"""Thrust over weight, or the reverse, that no flight keeps up; a wrong unit or a slipped digit is farther off."""

_CARRIES = 2.0  # Thrust over weight, or the reverse, that a flight has on average where unit and factors are right.
_FEWEST_ROTORS = 3  # Of fewer, propellers may be small.
_SPEEDS = {"rad/s": 1.0, "rpm": pi / 30, "Hz": 2 * pi}
_ABOVE_THE_LIMIT = 1.5
"""Measured speeds overshoot what a data sheet states; a wrong unit of speed is a factor of six at least."""

_LIFTS = 1.25  # Of 23 real flights with attitude and measured speeds the thrust carries 0.94 to 1.02 of what it has to.
IDLE = 0.5  # Share of the largest thrust below which rotors idle.
_TYPICAL = 0.03  # Thrust number of vehicles of 25 g to 25 kg, of propellers as large as the room: 0.012 to 0.05.
_LEANS = 0.03  # Spread of roll and pitch in rad that no vehicle at rest has.
_REMEDY = (
    "check the unit of import.signals.rotor_speed (or of rotor_command, and vehicle.rotor_speed_max_rad_s), "
    "vehicle.mass_kg, vehicle.gravity_m_s2 and thrust_factor_n_s2 of vehicle.rotors"
)


def too_fast(parts: Sequence[Signals]) -> Finding | None:
    """Hold the fastest rotor against the limit that the config states."""
    fastest = max((float(part.rotor_speed.max()) for part in parts if part.rotor_speed is not None), default=0.0)
    limit = parts[0].vehicle.rotor_speed_max_rad_s
    if fastest <= _ABOVE_THE_LIMIT * limit:
        return None
    return Finding(
        f"the rotors turn at up to {fastest:.4g} rad/s, but vehicle.rotor_speed_max_rad_s is {limit:.4g}",
        "check the unit of import.signals.rotor_speed (rpm?), or the limit",
        ("rotors", "vehicle.rotor_speed_max_rad_s"),
        fastest / limit,
    )


def beyond_propellers(parts: Sequence[Signals]) -> Finding | None:
    """Say where no propellers that fit between the hubs carry the mass at the measured speeds.

    Only where the thrust factor is a guess: one that carries the weight confirms the speeds. Rotors that idle
    on the ground lift nothing, so slow ones contradict only flights that lean; of fewer than three any may be small.
    """
    vehicle = parts[0].vehicle
    room = room_between(_hubs(vehicle))
    flown = [part for part in parts if part.rotor_speed is not None and not part.commanded]
    if "thrust_factor" not in vehicle.unknown or not flown or np.isnan(room):
        return None
    speed = np.concatenate([part.rotor_speed for part in flown if part.rotor_speed is not None])
    turning = _turning(speed)
    if not turning.any():
        return None
    number = thrust_number(vehicle.mass_kg, room, speed[turning])
    if IN_ROOM.allows(number):
        return None
    slow = number > IN_ROOM.possible[1]
    angles = np.concatenate([np.zeros((len(p), 2)) if p.attitude is None else p.attitude[:, :2] for p in flown])
    leans = float(angles[turning].std(axis=0).max()) > _LEANS
    size = number / _TYPICAL if slow else _TYPICAL / number
    return Finding(
        f"propellers that fit between the hubs lift about {size:.0f} times {'less' if slow else 'more'} than the "
        f"weight of {vehicle.mass_kg:g} kg at {np.sqrt((speed[turning] ** 2).mean()):.3g} rad/s",
        "check the unit of import.signals.rotor_speed (rad/s, rpm or Hz), vehicle.mass_kg (kg) and position_m of "
        f"vehicle.rotors (m){', or whether it took off at all' if slow else ''}",
        ("rotors", "vehicle"),
        number,
        contradiction=leans if slow else len(vehicle.rotors) >= _FEWEST_ROTORS,
    )


def _hubs(vehicle: VehicleSettings) -> Array:
    return np.array([rotor.position_m for rotor in vehicle.rotors])


def _turning(speed: Array) -> BoolArray:
    """Mark the samples at which rotors do not idle; none where they always stand."""
    power = (speed**2).sum(axis=1)
    # A flight of seconds in a long log on the ground is the largest thousandth.
    most = float(np.quantile(power, 0.999)) if len(power) else 0.0
    return power >= IDLE * most if most else np.zeros(len(power), dtype=bool)


class MeantUnit(NamedTuple):
    """The unit that speeds of rotors are likely in, and how many times the weight these lift in it and as declared."""

    unit: str
    lifts: float
    lifts_as_declared: float


def meant_unit(vehicle: VehicleSettings, speed: Array, attitude: Array | None, declared: str) -> MeantUnit | None:
    """Find in which unit the speeds of a flight carry its vehicle, where no vehicle flies with them as declared.

    `speed`, shape (time, rotor), rad/s: as read in the unit that is declared.
    `attitude`, shape (time, 3), rad: slow rotors may idle on the ground where it does not lean.
    None where they may be right, or no other unit makes them so.
    """
    turning, guessed = _turning(speed), "thrust_factor" in vehicle.unknown
    if len(vehicle.rotors) < _FEWEST_ROTORS or speed.shape[1] != len(vehicle.rotors) or not turning.any():
        return None
    if guessed:
        room = room_between(_hubs(vehicle))
        lifts = _TYPICAL / thrust_number(vehicle.mass_kg, room, speed[turning])
        possible, usual = ((_TYPICAL / most, _TYPICAL / least) for least, most in (IN_ROOM.possible, IN_ROOM.usual))
    else:
        factors = np.array([rotor.thrust_factor_n_s2 for rotor in vehicle.rotors])
        lifts = float((speed[turning] ** 2 @ factors).mean()) / (vehicle.mass_kg * vehicle.gravity_m_s2)
        possible, usual = (1 / _THRUST_TO_WEIGHT, _THRUST_TO_WEIGHT), (1 / _CARRIES, _CARRIES)
    if not lifts < possible[0] and not lifts > possible[1]:
        return None
    if lifts < possible[0] and (attitude is None or float(attitude[turning, :2].std(axis=0).max()) <= _LEANS):
        return None
    read = {unit: lifts * (factor / _SPEEDS[declared]) ** 2 for unit, factor in _SPEEDS.items()}
    fitting = [unit for unit, own in read.items() if usual[0] < own < usual[1]]
    # Of several, where the thrust factor is a guess, the one that is the most usual.
    unit = min(fitting, key=lambda unit: abs(np.log(read[unit] ** 2 / (usual[0] * usual[1]))), default=None)
    return None if unit is None else MeantUnit(unit, read[unit], lifts)


def thrust_against_weight(parts: Sequence[Signals]) -> Finding | None:
    """Say how the thrust lies to the weight where no flight has it so; nothing where a guess states it."""
    vehicle = parts[0].vehicle
    if "thrust_factor" in vehicle.unknown:
        return None
    known = [part.thrust for part in parts if part.rotor_speed is not None and part.thrust is not None]
    thrust = np.concatenate([*known, np.zeros(0)]) / (vehicle.mass_kg * vehicle.gravity_m_s2)
    # A log may hold a long rest on the ground, so that its mean says nothing of too little.
    mean, most = (float(thrust.mean()), float(thrust.max())) if len(thrust) else (1.0, 1.0)
    if mean > _THRUST_TO_WEIGHT:
        size, words = mean, "times the weight on average, which no flight sustains"
    elif most < 1 / _THRUST_TO_WEIGHT:
        size, words = most, "times the weight at most, which lifts no vehicle"
    else:
        return None
    return Finding(f"the thrust of the rotors is {size:.3g} {words}", _REMEDY, ("rotors", "vehicle"), size)


def thrust_is_known(parts: Sequence[Signals]) -> bool:
    """Check whether the size of the thrust says anything."""
    return "thrust_factor" not in parts[0].vehicle.unknown and thrust_against_weight(parts) is None


def weighed(part: Signals) -> Signals:
    """Scale thrust to the weight where its size says nothing, so that its direction still counts."""
    if part.rotor_speed is None or part.thrust is None or not part.thrust.any():
        return part
    scale = part.vehicle.mass_kg * part.vehicle.gravity_m_s2 / float(part.thrust.mean())
    rotors = tuple(replace(rotor, thrust_factor_n_s2=scale * rotor.thrust_factor_n_s2) for rotor in part.vehicle.rotors)
    return replace(part, vehicle=replace(part.vehicle, rotors=rotors))


def lift(checks: Sequence[PairCheck], vehicle: VehicleSettings) -> Finding | None:
    """Hold the thrust against what the motion takes along the vertical, where the rotors do not idle.

    A number of the vehicle that is a little off is what a diagnosis and a fit are about, and contradicts nothing.
    """
    against = by_thrust(checks)
    if not against:
        return None
    given, taken = (part[:, 2] + vehicle.gravity_m_s2 for part in (against[0].first, against[0].second))
    most = given.max()
    if most < vehicle.gravity_m_s2 / _THRUST_TO_WEIGHT:
        # On the ground, or reported already.
        return None
    flown = given > IDLE * most
    share = float(given[flown].mean() / taken[flown].mean())
    if 1 / _LIFTS < share < _LIFTS:
        return None
    what = f"the thrust of the rotors is {share:.2f} times what the motion requires along the vertical"
    return Finding(what, _REMEDY, ("rotors", "vehicle"), share, contradiction=False, repairable=True)


def misplaced(parts: Sequence[Signals]) -> Finding | None:
    """Say where the motion puts rotors that the config has elsewhere, or turning the other way.

    Of several flights or stretches one that says so clearly is enough; else the longest is asked.
    """
    found = [(part, _misplaced(part)) for part in sorted(parts, key=len, reverse=True)]
    clear = (own for _, own in found if own is not None and own.contradiction)
    return next(clear, found[0][1])


def _misplaced(part: Signals) -> Finding | None:
    if part.rotor_speed is None:
        return None
    moved = airframe_from_motion(part.body_rate, part.rotor_speed, 1 / part.period, part.commanded)
    if moved is None or not moved.by_axes:
        return None
    moving = [(rotor.name, rotor.spin) for rotor in moved.airframe.rotors]
    stated = [(place_of(each.position_m[:2]), each.spin) for each in part.vehicle.rotors]
    # Of rotors that are stated as another X or plus the motion says nothing.
    if moving == stated or {name for name, _ in moving} != {name for name, _ in stated}:
        return None
    places = "; ".join(f"{name}, {'counter-clockwise' if spin > 0 else 'clockwise'}" for name, spin in moving)
    shares = ", ".join(f"{100 * share:.0f} %" for share in moved.explained)
    return Finding(
        f"judged by the motion, the rotors are, in the order of their columns: {places} (which explains {shares} of "
        "the acceleration about roll, pitch and yaw). vehicle.rotors says otherwise",
        "check its position_m and spin, the order of the columns, the axes of the gyroscope (or attitude), and "
        "import.body_frame",
        ("rotors", "gyroscope", "vehicle.rotors"),
        # In a hover the axes may say it and single rotors not: enough for a word, not for a verdict.
        contradiction=moved.clear,
    )


_TOO_WIDE = 5.0
"""A frame may be wider than its rotors, and a paper may round; a slipped digit or g cm^2 is more than that."""

_INERTIAS = ("inertia_x", "inertia_y", "inertia_z")
_REVERSED = 0.005  # Ratio below which a torque has the wrong sign, or belongs to another axis.
_ALIKE = 0.3  # Largest logarithm of a ratio of two numbers that one mistake makes wrong.


def beyond_belief(vehicle: VehicleSettings) -> tuple[Finding, ...]:
    """Say which stated moments of inertia are those of no body so light between such rotors; nothing of guesses."""
    if "inertia" in vehicle.unknown:
        return ()
    stated = dict(zip((f"inertia.{name}" for name in INERTIA_PARAMETERS[:3]), vehicle.inertia_kg_m2, strict=False))
    hubs = np.array([rotor.position_m for rotor in vehicle.rotors])
    limits = beyond_any_body(vehicle.mass_kg * _TOO_WIDE, hubs, stated)
    return tuple(
        Finding(
            f"vehicle.inertia_kg_m2: {name.removeprefix('inertia.')} is {stated[name]:.3g} kg m^2, and a body of "
            f"{vehicle.mass_kg:.3g} kg between these rotors barely reaches {limit / _TOO_WIDE:.2g}",
            "check it, vehicle.mass_kg and position_m of vehicle.rotors",
            ("vehicle",),
            stated[name] * _TOO_WIDE / limit,
            # The motion identifies it: a fit finds another.
            contradiction=False,
        )
        for name, limit in limits.items()
        # Rotors that replace others, all in one place, have no size.
        if limit > 0
    )


def impossible(off: Mapping[str, float]) -> tuple[Finding, ...]:
    """Say of numbers of the vehicle that a fit asks for and no vehicle has what makes them so: the log is wrong.

    `off`: their ratios to the config.
    """
    return tuple(
        Finding(
            f"{NUMBERS[name]} would have to be {ratio:.3g} times that of the config, which no vehicle has",
            _suspect(off),
            ("rotors", "gyroscope", "vehicle"),
            ratio,
        )
        for name, ratio in off.items()
    )


def _suspect(off: Mapping[str, float]) -> str:
    """Say what makes just these numbers impossible: a torque or inertia that is wrong changes one ratio, a unit all."""
    thrust, inertias = off.get("thrust_scale"), [off[name] for name in _INERTIAS if name in off]
    if min(off.values()) < _REVERSED:
        if off.keys() == {"inertia_z"}:
            return "x and y fit, so check spin of vehicle.rotors, the order of the rotors' columns and the sign of yaw"
        if off.keys() == {"thrust_scale"}:
            return "check the sign and frame of the acceleration, and thrust_factor_n_s2 of vehicle.rotors"
        return "check the signs and order of the gyroscope's and the rotors' columns"
    if thrust is not None and off.keys() == {"thrust_scale", "inertia_z"} and _alike(thrust * off["inertia_z"], 1.0):
        return f"the rotor speeds look {_times(1 / np.sqrt(thrust))}: check the unit of their columns (rpm for rad/s?)"
    if off.keys() == {"thrust_scale"} and thrust is not None:
        return f"thrust_factor_n_s2 of vehicle.rotors looks {_times(1 / thrust)}, or mass_kg {_times(thrust)}"
    if off.keys() == {"inertia_z"}:
        ratio = off["inertia_z"]
        return (
            f"x and y fit, and about z only drag factor over inertia shows, so drag_factor_n_m_s2 of vehicle.rotors "
            f"looks {_times(ratio)}, or inertia_kg_m2 about z {_times(1 / ratio)}"
        )
    if off.keys() == set(_INERTIAS) and all(_alike(each, inertias[0]) for each in inertias):
        return f"all axes alike, so the gyroscope looks {_times(1 / inertias[0])}: check its unit (deg/s for rad/s?)"
    if off.keys() <= {"inertia_x", "inertia_y"}:
        return "z fits, so suspect inertia_kg_m2 about this axis and position_m of vehicle.rotors"
    return "check the signs, units and order of the gyroscope's and the rotors' columns"


def _alike(one: float, other: float) -> bool:
    return bool(abs(np.log(one / other)) < _ALIKE)


def _times(ratio: float) -> str:
    return f"{ratio:.3g} times too large" if ratio > 1 else f"{1 / ratio:.3g} times too small"
