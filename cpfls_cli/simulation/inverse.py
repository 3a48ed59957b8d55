"""Inverse dynamics: the torques, thrust and rotor speeds that a planned motion asks for, and whether a vehicle can."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics import body_torque, inertia_tensor
from cpfls_cli.errors import SettingError
from cpfls_cli.simulation.measured import noisy
from cpfls_cli.simulation.settings import SimulationSettings
from cpfls_cli.vehicle.rotors import RotorViolation, rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings


@dataclass(frozen=True)
class SimulatedFlight:
    """A flight of the exact vehicle, with noise where asked.

    Attributes
    ----------
    signals : mapping of str to array
        By the names of the flight artifact; time is the first axis.
    violations : tuple of RotorViolation
        What no rotor can do; `rotor_speed` is NaN there.
    noise_std : mapping of str to array
        Standard deviation of the noise added to each channel, by signal.
    """

    signals: Mapping[str, Array]
    violations: tuple[RotorViolation, ...]
    noise_std: Mapping[str, Array]


def simulate(
    planned: Mapping[str, Array], vehicle: VehicleSettings, settings: SimulationSettings, rng: np.random.Generator
) -> SimulatedFlight:
    """Compute the torques and rotor speeds that fly a planned motion.

    Parameters
    ----------
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, `position`, `velocity`, `acceleration`, shape
        (time, 3) each; without the last three the vehicle is held at its centre of mass and only turns.
    rng : numpy.random.Generator
        Source of the noise.

    Raises
    ------
    SettingError
        If a signal that a held vehicle does not have is to be noisy.
    ComputationError
        If the rotors cannot produce thrust, roll, pitch and yaw independently.

    References
    ----------
    Equations (1) and (2); method.md sections 1 and 2.
    """
    about_body, thrust = needed_wrench(planned, vehicle)
    demand = rotor_demand(vehicle, thrust, about_body)
    generalised = rotations.generalised_torque(planned["attitude"], about_body)
    exact = {**planned, "torque": generalised, "body_torque": about_body, "rotor_speed": demand.speed}
    _refuse_noise_of_nothing(exact, settings)
    signals, noise_std = noisy(exact, settings, rng)
    signals["torque"], signals["body_torque"] = _torques(signals, frozenset(noise_std))
    signals["body_rate"] = rotations.body_rate(signals["attitude"], signals["attitude_rate"])
    return SimulatedFlight(signals, demand.violations, noise_std)


@dataclass(frozen=True)
class TooMuch:
    """A demand of a motion beyond its limit.

    Attributes
    ----------
    what : str
        Thrust or tilt, with its unit.
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
    """Demands of a motion on a vehicle.

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
    about_body, thrust = needed_wrench(planned, vehicle)
    tilt = tilt_of(planned["attitude"])
    most = sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors) * vehicle.rotor_speed_max_rad_s**2
    limits = [("thrust, N", thrust, most)] + ([("tilt, rad", tilt, tilt_max)] if tilt_max else [])
    excesses = [too_much for name, values, limit in limits for too_much in _beyond(name, values, limit)]
    return Flyability(thrust, tilt, tuple(excesses), rotor_demand(vehicle, thrust, about_body).violations)


def tilt_of(attitude: Array) -> Array:
    """Compute the angle between thrust and vertical, shape (time,), rad, of attitudes, shape (time, 3), rad."""
    (sr, cr), (sp, cp) = ((np.sin(angle), np.cos(angle)) for angle in attitude.T[:2])
    # The arc cosine of the vertical component of body z would lose small angles.
    return np.asarray(np.arctan2(np.hypot(sp * cr, sr), cr * cp))


def needed_wrench(planned: Mapping[str, Array], vehicle: VehicleSettings) -> tuple[Array, Array]:
    """Compute the body torque, shape (time, 3), N m, and the thrust, shape (time,), N, that a motion needs."""
    rotation = planned["attitude"], planned["attitude_rate"], planned["attitude_acceleration"]
    about_body = body_torque(*rotation, inertia_tensor(vehicle))
    return about_body, collective_thrust(vehicle, about_body, planned.get("acceleration"))


def single_axis_torque(vehicle: VehicleSettings) -> Array:
    """Compute the largest torque about each axis alone, in either direction, of a held vehicle, shape (3,), N m."""
    both = np.concatenate([np.eye(3), -np.eye(3)])
    needed = rotor_demand(vehicle, collective_thrust(vehicle, both, None), both).squared_speed.max(axis=1)
    return np.asarray(vehicle.rotor_speed_max_rad_s**2 / np.maximum(needed[:3], needed[3:]))


def collective_thrust(vehicle: VehicleSettings, body_torque: Array, acceleration: Array | None) -> Array:
    """Compute the total thrust along body z, N, from body torque and acceleration in the world, None where it is held.

    In flight it is ``m |a + g e3|``. A vehicle that is held at its centre of mass has it free: it is then the smallest
    at which the torque asks no rotor to turn backwards, as every rotor of a lone thrust turns forwards.
    `ComputationError` where the rotors cannot produce thrust, roll, pitch and yaw independently, or a torque is not
    finite.
    """
    if acceleration is not None:
        specific_force = acceleration + np.array([0.0, 0.0, vehicle.gravity_m_s2])
        return np.asarray(vehicle.mass_kg * np.linalg.norm(specific_force, axis=1))
    none = np.zeros(len(body_torque))
    by_torque = rotor_demand(vehicle, none, body_torque).squared_speed
    by_thrust = rotor_demand(vehicle, np.ones(1), np.zeros((1, 3))).squared_speed[0]
    turning = by_thrust > 0
    least = np.maximum(-by_torque[:, turning] / by_thrust[turning], 0.0)
    return np.asarray(least.max(axis=1, initial=0.0))


def _refuse_noise_of_nothing(exact: Mapping[str, Array], settings: SimulationSettings) -> None:
    for key in ("noise", "relative_noise"):
        missing = sorted({str(name) for name in getattr(settings, key)} - exact.keys())
        if missing:
            raise SettingError(key, f"{', '.join(missing)}: a vehicle held at its centre of mass has none")


def _torques(signals: Mapping[str, Array], noised: frozenset[str]) -> tuple[Array, Array]:
    """Compute generalised and body torque; one without noise of its own follows from the other."""
    if "body_torque" in noised:
        return rotations.generalised_torque(signals["attitude"], signals["body_torque"]), signals["body_torque"]
    if noised & {"torque", "attitude"}:
        return signals["torque"], rotations.body_torque(signals["attitude"], signals["torque"])
    return signals["torque"], signals["body_torque"]


def _beyond(what: str, values: Array, limit: float) -> Iterator[TooMuch]:
    beyond: BoolArray = values > limit * (1 + 1e-12)
    if beyond.any():
        at = int(np.argmax(values))
        yield TooMuch(what, limit, float(values[at]), int(np.argmax(beyond)), at, int(beyond.sum()))
