"""Inverse dynamics of a vehicle along a planned motion: torques, rotor speeds, noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.simulation.noise import noisy
from cpfls_cli.simulation.settings import SimulationSettings
from cpfls_cli.vehicle.rigid_body import inertia_tensor, torque
from cpfls_cli.vehicle.rotors import rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.violations import RotorViolation


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
        (time, 3) each.
    vehicle : VehicleSettings
    settings : SimulationSettings
    rng : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    SimulatedFlight

    References
    ----------
    Equations (1) and (2); method.md sections 1 and 2.
    """
    q, qd, qdd = (planned[name] for name in ("attitude", "attitude_rate", "attitude_acceleration"))
    tau = torque(q, qd, qdd, inertia_tensor(vehicle))
    thrust = vehicle.mass_kg * np.linalg.norm(planned["acceleration"] + [0.0, 0.0, vehicle.gravity_m_s2], axis=1)
    demand = rotor_demand(vehicle, thrust, rotations.body_torque(q, tau))
    exact = {**planned, "torque": tau, "rotor_speed": demand.speed}
    signals, noise_std = noisy(exact, settings, rng)
    signals["body_torque"] = rotations.body_torque(signals["attitude"], signals["torque"])
    signals["body_rate"] = rotations.body_rate(signals["attitude"], signals["attitude_rate"])
    return SimulatedFlight(signals, demand.violations, noise_std)
