"""What the sensors of a flown vehicle log: signals with the faults that were asked for, and noise."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.effects.actuation import delayed
from cpfls_cli.simulation.closed_loop import FlownMotion
from cpfls_cli.simulation.flown_effects import MEASURING_POINT, FlownEffects
from cpfls_cli.simulation.noise import noisy
from cpfls_cli.simulation.plant import ATTITUDE, BODY_RATE, POSITION, VELOCITY
from cpfls_cli.simulation.settings import SimulationSettings
from cpfls_cli.vehicle.rotors import body_wrench
from cpfls_cli.vehicle.settings import VehicleSettings


def logged(
    time: Array,
    motion: FlownMotion,
    vehicle: VehicleSettings,
    settings: SimulationSettings,
    effects: FlownEffects,
    rng: np.random.Generator,
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Log a flight.

    Torques are those that the model gives the logged rotor speeds, or the logged commands where the speeds are
    hidden.

    Parameters
    ----------
    time : array, shape (time,), s
    motion : FlownMotion
    vehicle : VehicleSettings
    settings : SimulationSettings
    effects : FlownEffects
    rng : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    signals : dict of str to array
        By the names of the flight artifact.
    noise_std : dict of str to array
        Standard deviation of the noise of each channel, of the signals that have noise.
    """
    exact = {**_motion(motion, effects), **_actuation(time, motion, effects)}
    signals, noise_std = noisy(exact, settings, rng)
    speed = signals["rotor_command" if effects.hides_rotor_speed else "rotor_speed"]
    torque = rotations.generalised_torque(signals["attitude"], body_wrench(vehicle, speed).body_torque)
    stated, stated_std = noisy({"torque": torque}, settings, rng)
    signals |= {**stated, "body_torque": rotations.body_torque(signals["attitude"], stated["torque"])}
    return signals, noise_std | stated_std


def _motion(motion: FlownMotion, effects: FlownEffects) -> dict[str, Array]:
    attitude, body_rate = motion.state[:, ATTITUDE], motion.state[:, BODY_RATE]
    rate = rotations.attitude_rate(attitude, body_rate)
    turning = rotations.multiply(rotations.euler_rate_matrix_derivative(attitude, rate), rate)
    position, velocity, acceleration = _translation(motion, effects)
    return {
        "attitude": attitude,
        "attitude_rate": rate,
        "attitude_acceleration": rotations.attitude_rate(attitude, motion.change[:, BODY_RATE] - turning),
        "position": position,
        "velocity": velocity,
        "acceleration": acceleration,
        "body_rate": gyro(body_rate, effects),
    }


def _translation(motion: FlownMotion, effects: FlownEffects) -> Iterator[Array]:
    """Log position, velocity and acceleration of a point of the body, ``v + omega x r`` and so on."""
    wrong = effects.values("parameter_error") or {}
    point = np.array([wrong.get(name, 0.0) for name in MEASURING_POINT])
    body_rate, turning = motion.state[:, BODY_RATE], motion.change[:, BODY_RATE]
    moving = np.cross(body_rate, point)
    beside = (np.tile(point, (len(body_rate), 1)), moving, np.cross(turning, point) + np.cross(body_rate, moving))
    rotation = rotations.rotation_matrix(motion.state[:, ATTITUDE])
    centre = (motion.state[:, POSITION], motion.state[:, VELOCITY], motion.change[:, VELOCITY])
    return (known + rotations.multiply(rotation, more) for known, more in zip(centre, beside, strict=True))


def gyro(body_rate: Array, effects: FlownEffects) -> Array:
    """Read the body rates as a faulty gyro does, ``(1 + e) (omega - delta x omega) + b``.

    Parameters
    ----------
    body_rate : array, shape (time, 3), rad/s, body frame
    effects : FlownEffects

    Returns
    -------
    array, shape (time, 3), rad/s
    """
    turn, scale, bias = (_three(effects, name) for name in ("imu_misalignment", "gyro_scale", "gyro_bias"))
    return np.asarray((1 + scale) * (body_rate - np.cross(turn, body_rate)) + bias)


def _three(effects: FlownEffects, name: str) -> Array:
    values = effects.values(name)
    return np.zeros(3) if values is None else np.array(list(values.values()))


def _actuation(time: Array, motion: FlownMotion, effects: FlownEffects) -> dict[str, Array]:
    """Log rotor speeds, or the command that the slowest known link of the chain got.

    Without motor_lag a hidden flight logs the command after the autopilot's own smoothing, so that delay and sag are
    all that is left between log and rotors.
    """
    battery = {} if effects.values("battery_sag") is None else {"voltage": motion.voltage}
    if effects.hides_rotor_speed:
        return {"rotor_command": motion.followed if effects.values("motor_lag") is None else motion.told, **battery}
    shift = effects.values("channel_delay")
    speed = motion.speed if shift is None else delayed(motion.speed, time, -shift["delay_s"])
    return {"rotor_speed": speed, "rotor_command": motion.told}
