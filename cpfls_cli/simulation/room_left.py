"""What a motion takes of the rotors, and how much of an excitation they have room for beside a path."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.simulation.inverse import needed_wrench, tilt_of
from cpfls_cli.trajectory.excited import AddedMotion
from cpfls_cli.trajectory.planning import Trajectory
from cpfls_cli.trajectory.settings import TrajectorySettings
from cpfls_cli.vehicle.rotors import rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings

ROTOR_SHARE = 0.85
"""Of the largest speed of a rotor, and of the way down from hovering to rest, in squares: the rest is for control."""

_HALVINGS = 12
"""Of a bisection, to a four-thousandth of the size."""

_LEAST_SHARE = 0.02
"""Of the size asked for: less is refused."""


def squared_speeds(planned: Mapping[str, Array], vehicle: VehicleSettings) -> Array:
    """Compute the squared rotor speeds that a motion in space asks for.

    Parameters
    ----------
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, `acceleration`, shape (time, 3) each.

    Returns
    -------
    array, shape (time, rotor), rad^2/s^2
        Negative where no rotor can.
    """
    about_body, thrust = needed_wrench(planned, vehicle)
    squared: Array = rotor_demand(vehicle, thrust, about_body).squared_speed
    return squared


def hover_squared(vehicle: VehicleSettings) -> Array:
    """Compute the squared rotor speeds of hovering, shape (rotor,), rad^2/s^2."""
    weight = np.array([vehicle.mass_kg * vehicle.gravity_m_s2])
    squared: Array = rotor_demand(vehicle, weight, np.zeros((1, 3))).squared_speed[0]
    return squared


@dataclass(frozen=True)
class RotorLoad:
    """Largest shares that a motion takes of what rotors may do beside control, which is `ROTOR_SHARE` of all.

    `fast`: of the square of the largest speed; `slow`: of the way down from the squared speed of hovering to rest.
    """

    fast: float
    slow: float


def rotor_load(planned: Mapping[str, Array], vehicle: VehicleSettings) -> RotorLoad:
    """Compute what a motion in space takes of the rotors; `planned` as in `squared_speeds`."""
    squared, hover = squared_speeds(planned, vehicle), hover_squared(vehicle)
    fast = float((squared / (ROTOR_SHARE * vehicle.rotor_speed_max_rad_s**2)).max())
    return RotorLoad(fast, float(((hover - squared) / (ROTOR_SHARE * hover)).max()))


@dataclass(frozen=True)
class RoomLeft:
    """Excitation that fits beside its path, and what limits it.

    Attributes
    ----------
    added : AddedMotion
        Of the size asked for, or smaller.
    limits : tuple of str
        The limit that more of each axis would break, with its key; empty where all fits.
    """

    added: AddedMotion
    limits: tuple[str, ...]


def room_left(path: Trajectory, added: AddedMotion, settings: TrajectorySettings, vehicle: VehicleSettings) -> RoomLeft:
    """Find the largest sizes of an excitation, up to its own, that keep tilt, rotors and velocity within limits.

    First of each axis alone, then of all together, by one factor. Rotors keep some of what they have for control,
    unless the path alone already takes more.

    Parameters
    ----------
    path : Trajectory
        One run, without excitation.

    Raises
    ------
    SettingError
        If next to nothing of an axis fits; it names the key.
    """
    load = rotor_load(vars(path), vehicle)

    def exceeded(sizes: Array) -> str:
        return _exceeded(path, added.of_sizes(sizes), settings, vehicle, load)

    alone = [_largest(added.sizes * one, exceeded) for one in np.eye(len(added.axes))]
    together, shared = _largest(np.sum([sizes for sizes, _ in alone], axis=0), exceeded)
    limits = tuple(shared or limit for _, limit in alone)
    for axis, size, asked, limit in zip(added.axes, together, added.sizes, limits, strict=True):
        if size < _LEAST_SHARE * asked:
            raise SettingError(
                "excite.size_rad",
                f"there is room for only {np.degrees(size):.2g} degrees of {axis}: {limit}; lower the top of "
                f"excite.band_hz, leave {axis} out, fly a gentler path, or lower this",
            )
    return RoomLeft(added.of_sizes(together), limits)


def _largest(sizes: Array, exceeded: Callable[[Array], str]) -> tuple[Array, str]:
    """Find the largest share of sizes that exceeds nothing, by bisection, and the limit that more would."""
    limit = exceeded(sizes)
    if not limit:
        return sizes, ""
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        broken = exceeded(middle * sizes)
        low, high, limit = (low, middle, broken) if broken else (middle, high, limit)
    return low * sizes, limit


def _exceeded(
    path: Trajectory, added: AddedMotion, settings: TrajectorySettings, vehicle: VehicleSettings, alone: RotorLoad
) -> str:
    """Name the limit that path and excitation together exceed; empty where they keep all."""
    velocity = float(np.linalg.norm(added.motion[1], axis=1).max())
    if velocity > settings.excite.velocity_max_m_s:
        return f"the velocity that it adds (trajectory.excite.velocity_max_m_s = {settings.excite.velocity_max_m_s:g})"
    try:
        flown = vars(added.onto(path, vehicle.gravity_m_s2))
    except ComputationError:
        return "thrust, which must not vanish"
    most = settings.tilt_max_rad
    if most is not None and tilt_of(flown["attitude"]).max() > most:
        return f"tilt (trajectory.tilt_max_rad = {most:g})"
    load = rotor_load(flown, vehicle)
    if load.fast > max(1.0, alone.fast):
        share = f"{100 * ROTOR_SHARE:.0f} % of the square of vehicle.rotor_speed_max_rad_s"
        return f"rotor speed ({share} = {vehicle.rotor_speed_max_rad_s:g})"
    return (
        f"rotor speed (each rotor keeps {100 * (1 - ROTOR_SHARE):.0f} % of its thrust in hover)"
        if load.slow > max(1.0, alone.slow)
        else ""
    )
