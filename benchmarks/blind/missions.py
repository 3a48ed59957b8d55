"""What the pilot asks for: references of position and yaw with independent dither, sampled at 100 Hz."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

STEP = 0.01
MISSIONS = ("forward", "ground", "climb")


@dataclass(frozen=True)
class Mission:
    """References over time: position, velocity, acceleration (time, 3), yaw, yaw rate and tilt dither (time, 2)."""

    name: str
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    yaw: np.ndarray
    yaw_rate: np.ndarray
    tilt: np.ndarray

    def table(self):
        """Give all references as columns, shape (time, 13)."""
        parts = (self.position, self.velocity, self.acceleration, self.yaw[:, None], self.yaw_rate[:, None], self.tilt)
        return np.hstack(parts)

    def asked(self):
        """Give what a log may hold of it, by name, shape (time, 3) each."""
        sticks = np.column_stack((self.tilt, self.yaw_rate))
        return {"setpoint_position": self.position, "setpoint_velocity": self.velocity, "sticks": sticks}


def legs(rng, time, draw, shortest, longest):
    """Hold values given by ``draw()`` for random spans of time."""
    values, start = [], 0.0
    while start < time[-1] + STEP:
        span = rng.uniform(shortest, longest)
        values.append(np.tile(draw(), (round(span / STEP), 1)))
        start += round(span / STEP) * STEP
    return np.vstack(values)[: len(time)]


def smooth(values, lag, start=None):
    """Pass steps through three equal first-order lags (total delay ``lag``), from the first value or ``start``."""
    keep = np.exp(-STEP / (lag / 3))
    start = values[0] if start is None else start
    for _ in range(3):
        values = start + lfilter([1 - keep], [1, -keep], values - start, axis=0)
    return values


def multisine(rng, time, lowest, highest, rms, tones=6):
    """Sum tones of random phase with a given root mean square."""
    frequency = np.exp(rng.uniform(np.log(lowest), np.log(highest), tones))
    phase = rng.uniform(0, 2 * np.pi, tones)
    weight = rng.uniform(0.5, 1.0, tones)
    weight *= rms * np.sqrt(2) / np.linalg.norm(weight)
    return np.sin(2 * np.pi * np.outer(time, frequency) + phase) @ weight


def heading(rng, time, turn, dither):
    """Turn to random yaw angles, never faster than the craft can."""
    angle = [rng.uniform(-np.pi, np.pi)]

    def next_angle():
        angle[0] += rng.choice([-1, 1]) * rng.uniform(0.3, 1.0) * turn
        return np.array([angle[0]])

    asked = legs(rng, time, next_angle, 3.5, 6.0)[:, 0]
    return smooth(asked, 2.8) + multisine(rng, time, 0.15, 0.7, dither)


def forward_velocity(rng, time):
    """Fly 2 to 8 m/s in changing directions, with stops."""
    last = np.zeros(2)

    def draw():
        nonlocal last
        for _ in range(100):
            speed, way = rng.uniform(2, 8) * (rng.random() > 0.15), rng.uniform(0, 2 * np.pi)
            target = speed * np.array([np.cos(way), np.sin(way)])
            if np.linalg.norm(target - last) < 6.5:
                break
        last = target
        return np.append(target, rng.uniform(-0.8, 0.8))

    return smooth(legs(rng, time, draw, 3.2, 5.5), 2.4, start=0.0)


def climb_velocity(rng, time, induced):
    """Climb to 4 m/s and descend to 1.75 times the induced speed, some legs with forward speed."""

    def draw():
        sideways = rng.uniform(3, 5) * (rng.random() < 0.3)
        way = rng.uniform(0, 2 * np.pi)
        vertical = rng.uniform(-1.75, -0.3) * induced if rng.random() < 0.72 else rng.uniform(0.5, 4.0)
        return np.array([sideways * np.cos(way), sideways * np.sin(way), vertical])

    return smooth(legs(rng, time, draw, 2.8, 4.5), 2.0, start=0.0)


def drift_velocity(rng, time, speed):
    """Wander slowly around one place."""

    def draw():
        return np.append(rng.uniform(-speed, speed, 2), 0.0)

    return smooth(legs(rng, time, draw, 2.0, 4.0), 1.5, start=0.0)


def mission(name, vehicle, duration, rng):
    """Draw the references of one flight.

    ``forward`` flies fast with turns, ``ground`` hovers and tilts one to four rotor radii above ground,
    ``climb`` climbs and descends, ``hover`` stays nearly still at height.
    """
    time = np.arange(round(duration / STEP) + 2) * STEP
    slow = {"forward": 0.3, "climb": 0.3, "ground": 0.2, "hover": 0.3}[name]
    tilt = {"forward": 4.0, "climb": 4.0, "ground": 3.6, "hover": 1.5}[name]
    turn = {"forward": 1.4, "climb": 0.9, "ground": 0.9, "hover": 0.0}[name]
    yaw = heading(rng, time, turn, 0.02 if name == "hover" else 0.08)
    velocity = {
        "forward": lambda: forward_velocity(rng, time),
        "climb": lambda: climb_velocity(rng, time, vehicle.induced_speed),
        "ground": lambda: drift_velocity(rng, time, 0.4),
        "hover": lambda: drift_velocity(rng, time, 0.0),
    }[name]()
    position = np.cumsum(velocity, axis=0) * STEP
    position += {"forward": [0, 0, 60.0], "climb": [0, 0, 450.0], "ground": [0, 0, 0], "hover": [0, 0, 20.0]}[name]
    if name == "ground":
        radius = vehicle.rotor_radius
        # Craft with small rotors still need room for their tracking error.
        lowest = max(1.1 * radius, 0.09)
        height = legs(rng, time, lambda: np.array([rng.uniform(lowest, lowest + 2.4 * radius)]), 2.5, 4.5)
        position[:, 2] = smooth(height, 1.5)[:, 0]
        velocity[:, 2] = np.gradient(position[:, 2], STEP)
    dither = np.stack([multisine(rng, time, slow, 2.0, np.radians(tilt)) for _ in range(2)], axis=1)
    acceleration = np.gradient(velocity, STEP, axis=0)
    return Mission(name, position, velocity, acceleration, yaw, np.gradient(yaw, STEP), dither)
