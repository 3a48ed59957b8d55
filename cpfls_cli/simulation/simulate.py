"""Inverse dynamics of a vehicle along a planned motion: torques, rotor speeds, noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.rigid_body import body_torque, inertia_tensor, torque
from cpfls_cli.errors import SettingError
from cpfls_cli.simulation.collective import collective_thrust
from cpfls_cli.simulation.noise import noisy
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
    vehicle : VehicleSettings
    settings : SimulationSettings
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
    q, qd, qdd = (planned[name] for name in ("attitude", "attitude_rate", "attitude_acceleration"))
    inertia = inertia_tensor(vehicle)
    about_body = body_torque(q, qd, qdd, inertia)
    thrust = collective_thrust(vehicle, about_body, planned.get("acceleration"))
    demand = rotor_demand(vehicle, thrust, about_body)
    exact = {**planned, "torque": torque(q, qd, qdd, inertia), "body_torque": about_body, "rotor_speed": demand.speed}
    _refuse_noise_of_nothing(exact, settings)
    signals, noise_std = noisy(exact, settings, rng)
    signals["torque"], signals["body_torque"] = _torques(signals, frozenset(noise_std))
    signals["body_rate"] = rotations.body_rate(signals["attitude"], signals["attitude_rate"])
    return SimulatedFlight(signals, demand.violations, noise_std)


def _refuse_noise_of_nothing(exact: Mapping[str, Array], settings: SimulationSettings) -> None:
    for key in ("noise", "relative_noise"):
        missing = sorted({str(name) for name in getattr(settings, key)} - exact.keys())
        if missing:
            raise SettingError(key, f"{', '.join(missing)}: a vehicle that is held at its centre of mass has none")


def _torques(signals: Mapping[str, Array], noised: frozenset[str]) -> tuple[Array, Array]:
    """Generalised and body torque; whichever has no noise of its own follows from the other and the noisy attitude."""
    if "body_torque" in noised:
        return rotations.generalised_torque(signals["attitude"], signals["body_torque"]), signals["body_torque"]
    if noised & {"torque", "attitude"}:
        return signals["torque"], rotations.body_torque(signals["attitude"], signals["torque"])
    return signals["torque"], signals["body_torque"]
