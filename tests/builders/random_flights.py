"""Flights at random: their playback is held against another one, not against what any vehicle does."""

import numpy as np
from scipy.spatial.transform import Rotation

from cpfls_cli.playback.flight import MeasuredMotion, PlaybackFlight
from cpfls_cli.vehicle.settings import VehicleSettings

VEHICLE = VehicleSettings(inertia_kg_m2=(0.6, 0.7, 1.2, 0.02, -0.03, 0.01))


def flight_of(samples=80, period=0.01, seed=0, **changes):
    """Draw a flight; changes are those of its fields."""
    rng = np.random.default_rng(seed)
    time = period * np.arange(samples)
    turns = 0.4 * np.sin(np.outer(time, rng.uniform(1, 3, 3)) + rng.uniform(0, 6, 3))
    motion = MeasuredMotion(
        position=rng.uniform(-1, 1, 3) + np.outer(time, rng.uniform(-1, 1, 3)),
        velocity=np.cos(np.outer(time, rng.uniform(1, 3, 3)) + rng.uniform(0, 6, 3)),
        rotation=Rotation.from_euler("ZYX", turns).as_matrix(),
        rate=1.5 * np.sin(np.outer(time, rng.uniform(1, 3, 3)) + rng.uniform(0, 6, 3)),
        period=period,
    )
    hover = np.sqrt(6 * 9.81 / 4 / VEHICLE.rotors[0].thrust_factor_n_s2)
    speed = hover * (1 + 0.05 * np.sin(np.outer(time, rng.uniform(2, 6, 4)) + rng.uniform(0, 6, 4)))
    given = {"name": "flight", "motion": motion, "speed": speed, "hold": "linear", "stretches": (slice(0, samples),)}
    return PlaybackFlight(**{**given, **changes})
