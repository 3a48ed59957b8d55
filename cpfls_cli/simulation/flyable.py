"""Whether a vehicle can fly a planned motion: thrust, tilt, rotor speeds, with the time and place of the worst."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics.rigid_body import body_torque, inertia_tensor
from cpfls_cli.simulation.collective import collective_thrust
from cpfls_cli.vehicle.rotors import RotorViolation, rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings


@dataclass(frozen=True)
class TooMuch:
    """Something that a motion asks for beyond its limit.

    Attributes
    ----------
    what : str
        Thrust or tilt, with its unit.
    limit, worst : float
    first, at, count : int
        Indices of the first sample beyond the limit and of the worst, and the number of samples beyond it.
    """

    what: str
    limit: float
    worst: float
    first: int
    at: int
    count: int


@dataclass(frozen=True)
class Flyability:
    """What a motion asks of a vehicle.

    Attributes
    ----------
    thrust : array, shape (time,), N
    tilt : array, shape (time,), rad
        Angle between thrust and vertical.
    too_much : tuple of TooMuch
        Empty where thrust and tilt stay within their limits.
    rotors : tuple of RotorViolation
        Empty where every rotor can do what is asked.
    """

    thrust: Array
    tilt: Array
    too_much: tuple[TooMuch, ...]
    rotors: tuple[RotorViolation, ...]


def flyability(planned: Mapping[str, Array], vehicle: VehicleSettings, tilt_max: float | None) -> Flyability:
    """Check a planned motion against a vehicle.

    Parameters
    ----------
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration` and, unless the vehicle is held at its centre of mass,
        `acceleration`, shape (time, 3) each.
    vehicle : VehicleSettings
    tilt_max : float or None, rad
        Largest tilt allowed; None for any.

    Raises
    ------
    ComputationError
        If the rotors cannot produce thrust, roll, pitch and yaw independently.

    References
    ----------
    Section 2 of the paper; method.md sections 2 and 3.
    """
    attitude = planned["attitude"]
    rate, acceleration = planned["attitude_rate"], planned["attitude_acceleration"]
    about_body = body_torque(attitude, rate, acceleration, inertia_tensor(vehicle))
    thrust = collective_thrust(vehicle, about_body, planned.get("acceleration"))
    tilt = _tilt(attitude)
    limits = [("thrust, N", thrust, _most_thrust(vehicle))] + ([("tilt, rad", tilt, tilt_max)] if tilt_max else [])
    found = [too_much for name, values, limit in limits for too_much in _beyond(name, values, limit)]
    return Flyability(thrust, tilt, tuple(found), rotor_demand(vehicle, thrust, about_body).violations)


def single_axis_torque(vehicle: VehicleSettings) -> Array:
    """Find the largest torque about each axis alone, either way, that the rotors of a held vehicle can give.

    Returns
    -------
    array, shape (3,), N m, body frame
    """
    both = np.concatenate([np.eye(3), -np.eye(3)])
    needed = rotor_demand(vehicle, collective_thrust(vehicle, both, None), both).squared_speed.max(axis=1)
    return np.asarray(vehicle.rotor_speed_max_rad_s**2 / np.maximum(needed[:3], needed[3:]))


def _tilt(attitude: Array) -> Array:
    """Angle between body z and vertical; the arc cosine of its vertical component would lose small angles."""
    (sr, cr), (sp, cp) = ((np.sin(angle), np.cos(angle)) for angle in attitude.T[:2])
    return np.asarray(np.arctan2(np.hypot(sp * cr, sr), cr * cp))


def _most_thrust(vehicle: VehicleSettings) -> float:
    return sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors) * vehicle.rotor_speed_max_rad_s**2


def _beyond(what: str, values: Array, limit: float) -> Iterator[TooMuch]:
    beyond: BoolArray = values > limit * (1 + 1e-12)
    if beyond.any():
        at = int(np.argmax(values))
        yield TooMuch(what, limit, float(values[at]), int(np.argmax(beyond)), at, int(beyond.sum()))
