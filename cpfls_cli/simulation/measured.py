"""A measured flight: simulated in closed loop, logged by sensors with faults and noise, held against its plan."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.effects.hooks import TrueMotion
from cpfls_cli.simulation.autopilot import GyroscopeNoise, asked
from cpfls_cli.simulation.closed_loop import ClosedLoop, SimulatedMotion, clock_of, fly
from cpfls_cli.simulation.model import (
    Simulated,
    SimulatedEffects,
    Tracking,
    in_table,
    played_gusts,
    simulated_effects,
    values_of,
    with_effects,
)
from cpfls_cli.simulation.settings import SimulationSettings
from cpfls_cli.vehicle.motion import ATTITUDE, BODY_RATE, POSITION, VELOCITY
from cpfls_cli.vehicle.rotors import body_wrench, violations
from cpfls_cli.vehicle.settings import VehicleSettings

if TYPE_CHECKING:
    from cpfls_cli.playback.model import VehicleModel


def measure(
    time: Array,
    planned: Mapping[str, Array],
    vehicle: VehicleSettings,
    settings: SimulationSettings,
    rng: np.random.Generator,
    progress: Callable[[float, int], None] = lambda _done, _total: None,
    model: VehicleModel | None = None,
) -> Simulated:
    """Simulate a planned motion in closed loop and log it.

    Parameters
    ----------
    time : array, shape (time,), s
        Uniform.
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, `position`, `velocity`, `acceleration`, shape
        (time, 3) each.
    vehicle : VehicleSettings
        As its model has it.
    rng : numpy.random.Generator
        Source of gusts, then of noise.
    progress : callable
        Takes steps done and steps in all.
    model : VehicleModel or None
        In place of the vehicle; effects of the settings come on top of its own.

    Raises
    ------
    InputError
        If there is no such effect.
    SettingError
        If an effect has values that are missing or impossible, or gusts are asked for that no model holds.
    ComputationError
        If the plan is not sampled uniformly, or the vehicle leaves the path or overturns.
    """
    given = simulated_effects(settings.closed_loop.effects, vehicle)
    held, effects = with_effects(model, given)
    gusts, push = played_gusts(model, settings.closed_loop.gusts), None
    if gusts is not None:
        clock = clock_of(time, settings.closed_loop)
        push = gusts.drawn(rng, clock.step, clock.steps)
    felt = {str(name): std for name, std in settings.noise.items()}.get("body_rate", 0.0)
    # The gyroscope of the loop and that of the log are two, so that a log's noise is the same whoever flies.
    noise = None if settings.closed_loop.law is None or not felt else GyroscopeNoise(felt, rng.spawn(1)[0])
    loop = ClosedLoop(vehicle, settings.closed_loop, held, effects)
    motion = fly(loop, time, planned, progress, push, noise)
    signals, noise_std = _logged(time, motion, vehicle, settings, effects, rng)
    setpoints = asked(planned, vehicle, settings.closed_loop, motion.state)
    signals |= {f"setpoint_{name}": values for name, values in setpoints.items()}
    flown = effects if held is None else SimulatedEffects((*in_table(held).listed, *effects.listed))
    tracking = Tracking.of(
        motion.state[:, POSITION] - planned["position"], motion.state[:, ATTITUDE] - planned["attitude"]
    )
    beyond = violations(motion.demand, vehicle.rotor_speed_max_rad_s, time)
    return Simulated.of(time, signals, noise_std, beyond, effects=values_of(flown), tracking=tracking)


def _logged(
    time: Array,
    motion: SimulatedMotion,
    vehicle: VehicleSettings,
    settings: SimulationSettings,
    effects: SimulatedEffects,
    rng: np.random.Generator,
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Log a flight: signals, and the standard deviation of the noise of those that have some.

    Torques are those that the model gives the logged rotor speeds, or the logged commands where the speeds are
    hidden.
    """
    exact = {**_motion(motion), **_actuation(motion, effects)}
    signals, noise_std = noisy(_as_logged(exact, time, motion, effects), settings, rng)
    speed = signals["rotor_command" if effects.hides_rotor_speed else "rotor_speed"]
    torque = rotations.generalised_torque(signals["attitude"], body_wrench(vehicle, speed).body_torque)
    stated, stated_std = noisy({"torque": torque}, settings, rng)
    signals |= {**stated, "body_torque": rotations.body_torque(signals["attitude"], stated["torque"])}
    return signals, noise_std | stated_std


def _motion(motion: SimulatedMotion) -> dict[str, Array]:
    attitude, body_rate = motion.state[:, ATTITUDE], motion.state[:, BODY_RATE]
    return {
        "attitude": attitude,
        "attitude_rate": rotations.attitude_rate(attitude, body_rate),
        "attitude_acceleration": rotations.attitude_acceleration(attitude, body_rate, motion.change[:, BODY_RATE]),
        "position": motion.state[:, POSITION],
        "velocity": motion.state[:, VELOCITY],
        "acceleration": motion.change[:, VELOCITY],
        "body_rate": body_rate,
    }


def _actuation(motion: SimulatedMotion, effects: SimulatedEffects) -> dict[str, Array]:
    """Log rotor speeds, or the command where effects hide them.

    Where no effect replaces the lag of the rotors, a hidden flight logs the command after it, so that the effects are
    all that is left between log and rotors.
    """
    acting = [one.effect.actuation for one in effects.listed if one.effect.actuation is not None]
    if not acting:
        return {"rotor_speed": motion.speed, "rotor_command": motion.command}
    voltage = {"voltage": motion.voltage} if any(each.supply is not None for each in acting) else {}
    lag = any(each.lag is not None for each in acting)
    return {"rotor_command": motion.command if lag else motion.lagged, **voltage}


def _as_logged(
    signals: dict[str, Array], time: Array, motion: SimulatedMotion, effects: SimulatedEffects
) -> dict[str, Array]:
    """Apply the effects on the log, the last of the catalogue first."""
    truth = TrueMotion(
        time,
        rotations.rotation_matrix(motion.state[:, ATTITUDE]),
        motion.state[:, BODY_RATE],
        motion.change[:, BODY_RATE],
    )
    for one in reversed(effects.ordered):
        if one.effect.log is not None:
            signals = signals | one.effect.log.change(signals, truth, one.values)
    return signals


def noise_std(name: str, values: Array, settings: SimulationSettings) -> Array:
    """Combine absolute and relative noise of each channel, independent of each other, to its standard deviation."""
    absolute = {str(key): value for key, value in settings.noise.items()}.get(name, 0.0)
    relative = {str(key): value for key, value in settings.relative_noise.items()}.get(name, 0.0)
    if relative == 0.0:
        return np.full(values.shape[1:], absolute)
    known = [channel[np.isfinite(channel)] for channel in values.reshape(len(values), -1).T]
    spread = np.array([float(np.std(channel)) if len(channel) else 0.0 for channel in known])
    return np.hypot(absolute, relative * spread.reshape(values.shape[1:]))


def noisy(
    exact: Mapping[str, Array], settings: SimulationSettings, rng: np.random.Generator
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Add white noise to signals.

    Parameters
    ----------
    exact : mapping of str to array
        By name; time is the first axis.

    Returns
    -------
    signals : dict of str to array
    std : dict of str to array
        Standard deviation of each channel, of the signals that have noise.
    """
    std = {name: deviation for name in exact if np.any(deviation := noise_std(name, exact[name], settings))}
    signals = {
        name: values + std[name] * rng.standard_normal(values.shape) if name in std else values
        for name, values in exact.items()
    }
    return signals, std
