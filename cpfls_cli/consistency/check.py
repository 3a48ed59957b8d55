"""What of a flight contradicts itself or its vehicle, where nobody audits its sensors: units, axes, signs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from cpfls_cli.consistency.audit import gross_faults
from cpfls_cli.consistency.majority import settled
from cpfls_cli.consistency.motion import PairCheck, by_thrust
from cpfls_cli.effects.signals import Signals, stretch_of
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.airframe import RotorPlace, airframe_from_motion, disagreement_on_rotors
from cpfls_cli.flightlog.quality import warn_of_disagreement
from cpfls_cli.inertia import INERTIA_PARAMETERS, beyond_any_body
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import FEWEST_WINDOWS, WindowSettings, windows

# A wrong unit or a slipped digit is farther from the weight.
_THRUST_TO_WEIGHT = 5.0
# Measured speeds overshoot what a data sheet states; a wrong unit of speed is a factor of six at least.
_ABOVE_THE_LIMIT = 1.5
# Of 23 real flights with attitude and measured speeds the thrust carries 0.94 to 1.02 of what it has to.
_LIFTS = 1.25
_IDLE = 0.5
_HANGS = -0.5
"""Mean upward part of body z below which an attitude is turned over; full rotations come to 0."""
_OF_THRUST = (
    "check the unit of import.signals.rotor_speed (or rotor_command), vehicle.mass_kg, vehicle.gravity_m_s2 and "
    "thrust_factor_n_s2 of vehicle.rotors"
)
_TOO_WIDE = 5.0
_ENOUGH = 50_000
"""Samples that tell units, axes and which rotor is where."""


def beyond_belief(vehicle: VehicleSettings) -> tuple[str, ...]:
    """Say which stated moments of inertia are those of no body so light between such rotors; nothing of guesses."""
    if "inertia" in vehicle.unknown:
        return ()
    stated = dict(zip((f"inertia.{name}" for name in INERTIA_PARAMETERS[:3]), vehicle.inertia_kg_m2, strict=False))
    hubs = np.array([rotor.position_m for rotor in vehicle.rotors])
    # A frame may be wider than its rotors, and a paper may round; a slipped digit or g cm^2 is more than that.
    limits = beyond_any_body(vehicle.mass_kg * _TOO_WIDE, hubs, stated)
    return tuple(
        f"vehicle.inertia_kg_m2: {name.removeprefix('inertia.')} is {stated[name]:.3g} kg m^2, and a body of "
        f"{vehicle.mass_kg:.3g} kg between these rotors has hardly {limit / _TOO_WIDE:.2g}: check it, vehicle.mass_kg "
        "and position_m of vehicle.rotors"
        for name, limit in limits.items()
        # Rotors that stand for others, all in one place, tell no size.
        if limit > 0
    )


def contradictions(parts: Sequence[Signals], settings: WindowSettings) -> tuple[str, ...]:
    """Hold the channels of a flight against each other and against its vehicle; nothing is set right.

    Parameters
    ----------
    parts : sequence of Signals
        Stretches of one flight; those too short for windows are left out.
    settings : GapSettings
        `window_s` and `overlap`, as in the sensor audit.

    Returns
    -------
    tuple of str
        What is wrong, who says so, and what to mend, to stand behind the name of the flight.
    """
    return tuple(f"{found[0].lower()}{found[1:].removesuffix('.')}" for found in _found(parts, settings))


def _middle(parts: Sequence[Signals]) -> list[Signals]:
    """Take no more of a long log than tells units and axes, from the middle of where its rotors turn."""
    if sum(len(part) for part in parts) <= _ENOUGH:
        return list(parts)
    longest = max(parts, key=len)
    centre = len(longest) // 2
    if longest.rotor_speed is not None:
        power = (longest.rotor_speed**2).sum(axis=1)
        centre = int(np.median(np.flatnonzero(power >= _IDLE * np.quantile(power, 0.99))))
    first = max(0, min(centre - _ENOUGH // 2, len(longest) - _ENOUGH))
    return [stretch_of(longest, slice(first, first + _ENOUGH))]


def _found(parts: Sequence[Signals], settings: WindowSettings) -> Iterator[str]:
    yield from _too_fast(parts)
    about_thrust = _of_thrust(parts)
    if about_thrust:
        yield f"The thrust of the rotors is {about_thrust}: {_OF_THRUST}."
    parts = _middle(parts)
    if parts[0].attitude is not None and np.concatenate([part.rotation[:, 2, 2] for part in parts]).mean() < _HANGS:
        yield (
            "By its attitude the vehicle hangs upside down on average: check import.world_frame, import.body_frame and "
            "the order of the quaternion."
        )
        return
    yield from _misplaced(max(parts, key=len))
    try:
        shared = windows(parts[0].period, settings.window_s, settings.overlap)
    except InputError:
        return
    told = not about_thrust and "thrust_factor" not in parts[0].vehicle.unknown
    long = [part if told else _weighed(part) for part in parts if shared.count(len(part))]
    if sum(shared.count(len(part)) for part in long) < FEWEST_WINDOWS:
        return
    yield from gross_faults(long, shared)
    motion = settled(long, shared)
    yield from (repair.unrepaired for repair in motion.repairs if repair.unrepaired)
    yield from motion.warnings
    if told and not motion.against_thrust:
        yield from _of_lift(motion.checks, long[0].vehicle)


def _of_lift(checks: Sequence[PairCheck], vehicle: VehicleSettings) -> Iterator[str]:
    """Hold the thrust against what the motion takes along the vertical, where the rotors do not idle."""
    against = by_thrust(checks)
    if not against:
        return
    given, taken = (part[:, 2] + vehicle.gravity_m_s2 for part in (against[0].first, against[0].second))
    most = given.max()
    if most < vehicle.gravity_m_s2 / _THRUST_TO_WEIGHT:
        # On the ground, or told already.
        return
    flown = given > _IDLE * most
    share = float(given[flown].mean() / taken[flown].mean())
    if not 1 / _LIFTS < share < _LIFTS:
        yield f"The thrust of the rotors is {share:.2f} times what the motion takes along the vertical: {_OF_THRUST}."


def _too_fast(parts: Sequence[Signals]) -> Iterator[str]:
    fastest = max((float(part.rotor_speed.max()) for part in parts if part.rotor_speed is not None), default=0.0)
    limit = parts[0].vehicle.rotor_speed_max_rad_s
    if fastest > _ABOVE_THE_LIMIT * limit:
        yield (
            f"The rotors turn at up to {fastest:.4g} rad/s, and vehicle.rotor_speed_max_rad_s is {limit:.4g}: check "
            "the unit of import.signals.rotor_speed (rpm?), or the limit."
        )


def _of_thrust(parts: Sequence[Signals]) -> str:
    """Say how the thrust lies to the weight where no flight has it so; nothing where a guess states it."""
    vehicle = parts[0].vehicle
    if "thrust_factor" in vehicle.unknown:
        return ""
    known = [part.thrust for part in parts if part.rotor_speed is not None and part.thrust is not None]
    thrust = np.concatenate([*known, np.zeros(0)]) / (vehicle.mass_kg * vehicle.gravity_m_s2)
    # A log may hold a long rest on the ground, so that its mean says nothing of too little.
    if len(thrust) and thrust.mean() > _THRUST_TO_WEIGHT:
        return f"{thrust.mean():.3g} times the weight on average, which no flight keeps up"
    if len(thrust) and thrust.max() < 1 / _THRUST_TO_WEIGHT:
        return f"{thrust.max():.3g} times the weight at most, which lifts no vehicle"
    return ""


def _misplaced(part: Signals) -> Iterator[str]:
    if part.rotor_speed is None:
        return
    if part.attitude is not None and warn_of_disagreement(part.time, part.attitude, part.body_rate):
        # A gyroscope that the attitude contradicts tells of no rotor.
        return
    moved = airframe_from_motion(part.body_rate, part.rotor_speed, 1 / part.period, part.commanded)
    stated = [RotorPlace("", each.position_m[:2], each.spin) for each in part.vehicle.rotors]
    elsewhere = "" if moved is None else disagreement_on_rotors(moved, stated)
    if elsewhere:
        yield (
            f"By the motion the rotors are, in the order of their columns: {elsewhere}. vehicle.rotors says otherwise: "
            "check position_m and spin there, the order of the columns, the axes of gyroscope (or attitude), and "
            "import.body_frame."
        )


def _weighed(part: Signals) -> Signals:
    """Scale thrust to the weight where its size says nothing, so that its direction still bears witness."""
    if part.rotor_speed is None or part.thrust is None or not part.thrust.any():
        return part
    scale = part.vehicle.mass_kg * part.vehicle.gravity_m_s2 / float(part.thrust.mean())
    rotors = tuple(replace(rotor, thrust_factor_n_s2=scale * rotor.thrust_factor_n_s2) for rotor in part.vehicle.rotors)
    return replace(part, vehicle=replace(part.vehicle, rotors=rotors))
