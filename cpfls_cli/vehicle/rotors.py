"""Rotors: the wrench of given speeds, the speeds of a given wrench, and demands that no rotor can meet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, require_columns
from cpfls_cli.errors import ComputationError
from cpfls_cli.inertia import symmetric
from cpfls_cli.result import about, result
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle_limits import Figures, figures_of, figures_of_hubs

AXES = ("thrust", "roll", "pitch", "yaw")
# Fraction of the largest squared speed that is rounding error of the allocation.
_ROUNDING = 1e-12
# Share of the arm by which hubs may miss each other and be opposite: digits of a config.
_SAME_PLACE = 1e-6


class BodyWrench(NamedTuple):
    """Thrust and torque of the rotors on the body.

    Attributes
    ----------
    thrust : array, shape (time,), N
        Along body z.
    body_torque : array, shape (time, 3), N m, body frame
        About the centre of mass.
    """

    thrust: Array
    body_torque: Array


@result
class Infeasible:
    """Samples at which a rotor was asked for what it cannot do."""

    rotor: int = about("number of the rotor, from 1")
    kind: str = about("``negative squared speed`` or ``above the limit``")
    first_s: float = about("first of them", unit="s")
    last_s: float = about("last of them", unit="s")
    samples: int = about("how many, which need not be all between")
    worst: float = about("squared speed that is farthest off", unit="rad^2/s^2")


@dataclass(frozen=True, kw_only=True)
class RotorDemand:
    """Rotor speeds that a wrench requires; nothing is clipped.

    The squared speed, rad^2/s^2, is as the allocation gives it, so it may be negative or too large; the speed, rad/s,
    is NaN where the rotor cannot turn so.
    """

    squared_speed: Array
    speed: Array


def allocation_matrix(vehicle: VehicleSettings) -> Array:
    """Map squared rotor speeds to thrust and body torque.

    A rotor at (x, y, z) gives ``(k, y k, -x k, -spin b)``.

    Returns
    -------
    array, shape (4, rotor)
        Rows are thrust in N, then roll, pitch and yaw torque in N m, for 1 rad^2/s^2.

    References
    ----------
    Section 2 of the paper.
    """
    columns = []
    for rotor in vehicle.rotors:
        x, y, _ = rotor.position_m
        k, b = rotor.thrust_factor_n_s2, rotor.drag_factor_n_m_s2
        columns.append([k, y * k, -x * k, -rotor.spin * b])
    return np.array(columns).T


def with_factors(vehicle: VehicleSettings, thrust: float, drag: float) -> VehicleSettings:
    """Multiply the thrust and drag factors of all rotors, each by a ratio."""
    return replace(
        vehicle,
        rotors=tuple(
            replace(
                rotor,
                thrust_factor_n_s2=thrust * rotor.thrust_factor_n_s2,
                drag_factor_n_m_s2=drag * rotor.drag_factor_n_m_s2,
            )
            for rotor in vehicle.rotors
        ),
    )


def figures_of_vehicle(vehicle: VehicleSettings) -> Figures:
    """Give the numbers of a vehicle that say whether there can be such a one; those that are guesses are not known."""
    rotors, moments = vehicle.rotors, np.linalg.eigvalsh(symmetric(vehicle.inertia_kg_m2))
    known = {"mass": vehicle.mass_kg, "gravity": vehicle.gravity_m_s2, "speed_max": vehicle.rotor_speed_max_rad_s}
    known |= figures_of_hubs(np.array([rotor.position_m for rotor in rotors]))
    if "inertia" not in vehicle.unknown:
        known |= {"least_inertia": float(moments[0]), "inertia": float(moments[-1])}
    if "thrust_factor" not in vehicle.unknown:
        known["thrust_factor"] = float(np.mean([rotor.thrust_factor_n_s2 for rotor in rotors]))
    if "drag_factor" not in vehicle.unknown:
        known["drag_factor"] = float(np.mean([rotor.drag_factor_n_m_s2 for rotor in rotors]))
    radii = [rotor.radius_m for rotor in rotors if rotor.radius_m is not None]
    if radii:
        known["radius"] = float(np.mean(radii))
    return figures_of(**known)


def body_wrench(vehicle: VehicleSettings, rotor_speed: Array, allocation: Array | None = None) -> BodyWrench:
    """Compute thrust and body torque from rotor speeds.

    Parameters
    ----------
    rotor_speed : array, shape (time, rotor), rad/s
    allocation : array, shape (4, rotor), or None
        `allocation_matrix` of the vehicle, where it was computed before.
    """
    require_columns("rotor_speed", rotor_speed, len(vehicle.rotors))
    wrench = rotor_speed**2 @ (allocation_matrix(vehicle) if allocation is None else allocation).T
    return BodyWrench(thrust=wrench[:, 0], body_torque=wrench[:, 1:])


def require_control(vehicle: VehicleSettings) -> None:
    """Refuse rotors that no vehicle flies with.

    Raises
    ------
    ComputationError
        If they cannot produce thrust, roll, pitch and yaw independently.
    """
    _allocation_inverse(allocation_matrix(vehicle))


def rotor_demand(vehicle: VehicleSettings, thrust: Array, body_torque: Array) -> RotorDemand:
    """Compute the rotor speeds that give a wrench, of minimum norm in the squared speeds.

    Parameters
    ----------
    thrust : array, shape (time,), N
        Along body z.
    body_torque : array, shape (time, 3), N m, body frame

    Returns
    -------
    RotorDemand
        The squared speeds are the minimum-norm solution where more than four rotors leave a choice.

    Raises
    ------
    ComputationError
        If the rotors cannot produce thrust, roll, pitch and yaw independently, or the wrench is not finite.
    """
    require_columns("body_torque", body_torque, 3)
    wrench = np.column_stack([thrust, body_torque])
    if not np.isfinite(wrench).all():
        sample = int(np.flatnonzero(~np.isfinite(wrench).all(axis=1))[0])
        raise ComputationError(f"the demanded thrust or torque is not finite at sample {sample}")
    squared_speed = wrench @ _allocation_inverse(allocation_matrix(vehicle)).T
    negative, above = _impossible(squared_speed, vehicle.rotor_speed_max_rad_s)
    speed = np.sqrt(np.where(negative | above, np.nan, np.maximum(squared_speed, 0.0)))
    return RotorDemand(squared_speed=squared_speed, speed=speed)


def _allocation_inverse(allocation: Array) -> Array:
    # Yaw is weaker than thrust by orders of magnitude; rows of equal length make the rank a matter of geometry.
    length = np.linalg.norm(allocation, axis=1)
    scaled = allocation / np.where(length > 0, length, 1.0)[:, None]
    left, singular_values, _ = np.linalg.svd(scaled)
    rank = int((singular_values > 1e-9 * singular_values[0]).sum())
    if rank < 4:
        unreachable = np.abs(left[:, rank:]).max(axis=1) > 1e-6
        missing = [axis for axis, beyond in zip(AXES, unreachable, strict=True) if beyond]
        raise ComputationError(
            f"vehicle.rotors: the rotors cannot produce {', '.join(missing)} independently of the rest; check their "
            "positions and spins"
        )
    inverse: Array = np.linalg.pinv(scaled) / length
    return inverse


def violations(squared_speed: Array, speed_max: float, time: Array) -> tuple[Infeasible, ...]:
    """Summarise the squared speeds that cannot be reached, by rotor and kind.

    Parameters
    ----------
    squared_speed : array, shape (time, rotor), rad^2/s^2
    speed_max : float, rad/s
    time : array, shape (time,), s

    Returns
    -------
    tuple of Infeasible
        At most two for each rotor, in the order of the rotors.
    """
    negative, above = _impossible(squared_speed, speed_max)
    found = []
    for rotor, demand in enumerate(squared_speed.T):
        kinds = ("negative squared speed", negative, demand.min), ("above the limit", above, demand.max)
        for kind, beyond, worst in kinds:
            when = time[beyond[:, rotor]].tolist()
            if when:
                ends = {"first_s": when[0], "last_s": when[-1]}
                found.append(Infeasible(rotor=rotor + 1, kind=kind, **ends, samples=len(when), worst=float(worst())))
    return tuple(found)


def _impossible(squared_speed: Array, speed_max: float) -> tuple[BoolArray, BoolArray]:
    """Mark squared speeds below 0, and those above the limit."""
    share = squared_speed / speed_max**2
    return share < -_ROUNDING, share > 1 + _ROUNDING


def opposite_pairs(vehicle: VehicleSettings) -> tuple[tuple[int, int], ...]:
    """Find the pairs of rotors that face each other across the middle of all and spin the same way.

    The centre of mass may lie off the middle, as that of a vehicle out of trim does.

    Result: indices from 0, in the order of the first rotor of each pair.
    """
    hubs = np.array([rotor.position_m[:2] for rotor in vehicle.rotors])
    hubs = hubs - hubs.mean(axis=0)
    spins = np.array([rotor.spin for rotor in vehicle.rotors])
    apart = np.linalg.norm(hubs[:, None] + hubs[None], axis=2)
    facing = (apart <= _SAME_PLACE * np.abs(hubs).max()) & (spins[:, None] == spins)
    return tuple((int(first), int(second)) for first, second in np.argwhere(facing) if first < second)


def gain_modes(vehicle: VehicleSettings) -> Array:
    """Construct patterns of thrust gain that no wrong inertia can mimic.

    For a quadrotor they are the differences of its two opposite pairs. For other vehicles they grow along x and y, and
    from six rotors on along both with the sign of the spin as well: one weak rotor is a sum of these, but for what
    trades with the inertia. What all rotors, or all rotors of one spin, have in common is taken out for that.

    Result: shape (rotor, 2) or (rotor, 4); gain of each rotor for a difference of 1 from end to end.
    """
    spins = np.array([float(rotor.spin) for rotor in vehicle.rotors])
    common = np.column_stack([np.ones_like(spins), spins])
    seeds = _seeds(vehicle)
    modes = seeds - common @ np.linalg.lstsq(common, seeds, rcond=None)[0]
    # What acts by rounding alone would be written into every export.
    return np.where(np.abs(modes) > 1e-12 * np.abs(seeds).max(), modes, 0.0)


def _seeds(vehicle: VehicleSettings) -> Array:
    hubs = np.array([rotor.position_m[:2] for rotor in vehicle.rotors])
    pairs = opposite_pairs(vehicle)
    if len(pairs) != 2 or len(hubs) != 4:
        along = hubs / np.ptp(hubs, axis=0)
        spins = np.array([[float(rotor.spin)] for rotor in vehicle.rotors])
        return np.hstack([along, along * spins]) if len(hubs) >= 6 else along
    seeds = np.zeros((4, 2))
    for mode, (first, second) in enumerate(pairs):
        seeds[[first, second], mode] = 0.5, -0.5
    return seeds
