"""A measured flight: flown in closed loop, logged by sensors, compared with its plan."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.simulation.closed_loop import fly
from cpfls_cli.simulation.flown_effects import FlownEffects, flown_effects
from cpfls_cli.simulation.flown_model import FlownModel
from cpfls_cli.simulation.plant import ATTITUDE, POSITION
from cpfls_cli.simulation.sensors import logged
from cpfls_cli.simulation.settings import SimulationSettings
from cpfls_cli.vehicle.rotors import RotorViolation, violations
from cpfls_cli.vehicle.settings import VehicleSettings


@dataclass(frozen=True)
class MeasuredFlight:
    """A flight as its log has it.

    Attributes
    ----------
    signals : mapping of str to array
        By the names of the flight artifact; time is the first axis.
    noise_std : mapping of str to array
        Standard deviation of the noise added to each channel, by signal.
    violations : tuple of RotorViolation
        What the autopilot asked for and no rotor can do; the commands were clipped there.
    effects : FlownEffects
        What was flown: the truth that a diagnosis has to find.
    position_error, attitude_error : array, shape (time, 3), m and rad
        Flown minus planned, without the noise.
    """

    signals: Mapping[str, Array]
    noise_std: Mapping[str, Array]
    violations: tuple[RotorViolation, ...]
    effects: FlownEffects
    position_error: Array
    attitude_error: Array


def measure(
    time: Array,
    planned: Mapping[str, Array],
    vehicle: VehicleSettings,
    settings: SimulationSettings,
    rng: np.random.Generator,
    progress: Callable[[float, int], None] = lambda _done, _total: None,
    model: FlownModel | None = None,
) -> MeasuredFlight:
    """Fly a planned motion in closed loop and log it.

    Parameters
    ----------
    time : array, shape (time,), s
        Uniform.
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, `position`, `velocity`, `acceleration`, shape
        (time, 3) each.
    vehicle : VehicleSettings
        As its model has it.
    settings : SimulationSettings
    rng : numpy.random.Generator
        Source of the noise.
    progress : callable
        Takes steps done and steps in all.
    model : FlownModel or None
        What is flown in place of the vehicle; effects of the settings come on top of its own.

    Raises
    ------
    InputError
        If there is no such effect.
    SettingError
        If an effect has values that are missing or impossible.
    ComputationError
        If the plan is not sampled uniformly, or the vehicle leaves the path or overturns.
    """
    flown = (model or FlownModel()).with_effects(flown_effects(settings.closed_loop.effects, vehicle))
    motion = fly(time, planned, vehicle, settings.closed_loop, flown, progress)
    signals, noise_std = logged(time, motion, vehicle, settings, flown.effects, rng)
    return MeasuredFlight(
        signals,
        noise_std,
        violations(motion.demand, vehicle.rotor_speed_max_rad_s),
        flown.effects,
        motion.state[:, POSITION] - planned["position"],
        motion.state[:, ATTITUDE] - planned["attitude"],
    )
