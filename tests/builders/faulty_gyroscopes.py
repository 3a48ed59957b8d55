"""Flights that turn as a sum of sines, seen by a gyroscope with known faults; nothing is taken from the package."""

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from cpfls_cli.effects.signals import Signals
from cpfls_cli.vehicle.settings import VehicleSettings

LEVELS = {"low": (0.001, 0.05), "mid": (0.005, 0.2), "high": (0.02, 0.6)}
"""Gyroscope, rad/s, and attitude, deg."""


@dataclass(frozen=True)
class Faults:
    bias: np.ndarray = field(default_factory=lambda: np.zeros(3))
    scale: np.ndarray = field(default_factory=lambda: np.zeros(3))
    misalignment: np.ndarray = field(default_factory=lambda: np.zeros(3))
    delay: float = 0.0


def motion(rng, amplitude, fastest_hz=1.2, sines=8):
    """Roll, pitch, yaw and the body rate as functions of time, the rate by the chain rule."""
    frequency = rng.uniform(0.08, fastest_hz, (3, sines))
    phase = rng.uniform(0, 2 * np.pi, (3, sines))
    size = np.array(amplitude)[:, None] * rng.uniform(0.5, 1.5, (3, sines)) * np.sqrt(2 / sines)

    def attitude(t):
        return (size[..., None] * np.sin(2 * np.pi * frequency[..., None] * t + phase[..., None])).sum(axis=1).T

    def rate(t):
        turn = 2 * np.pi * frequency
        change = (size * turn)[..., None] * np.cos(turn[..., None] * t + phase[..., None])
        (roll, pitch, _), (dr, dp, dy) = attitude(t).T, change.sum(axis=1)
        return np.column_stack(
            [
                dr - np.sin(pitch) * dy,
                np.cos(roll) * dp + np.sin(roll) * np.cos(pitch) * dy,
                -np.sin(roll) * dp + np.cos(roll) * np.cos(pitch) * dy,
            ]
        )

    return attitude, rate


def noise(rng, shape, size, coloured):
    white = rng.standard_normal(shape)
    return size * (lfilter([np.sqrt(1 - 0.81)], [1, -0.9], white, axis=0) if coloured else white)


def faulty_flight(
    rng, faults, level=(0.0, 0.0), *, coloured=False, amplitude=(0.14, 0.14, 0.3), duration=30.0, period=0.01
):
    attitude, rate = motion(rng, amplitude)
    time = np.arange(round(duration / period)) * period
    turned = Rotation.from_rotvec(-faults.misalignment).as_matrix()
    gyro = rate(time - faults.delay) @ (np.diag(1 + faults.scale) @ turned).T + faults.bias
    gyro = gyro + noise(rng, gyro.shape, level[0], coloured)
    gyro = np.round(gyro / 0.001) * 0.001
    seen = attitude(time) + noise(rng, gyro.shape, np.radians(level[1]), coloured)
    return Signals(time=time, body_rate=gyro, vehicle=VehicleSettings(), attitude=seen)


def faulty_flights(rng, faults, number=3, **options):
    return [faulty_flight(rng, faults, **options) for _ in range(number)]
