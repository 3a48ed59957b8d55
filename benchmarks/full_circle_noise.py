"""Print where each class of models wins: by noise of the torque, for a rigid vehicle and for one that is not.

    python benchmarks/full_circle_noise.py

All learn from the path optimised for the paper's structure, with 0, 1 or 5 % of white noise on each torque, and are
judged without noise on eight random flights of full rotations: largest error over largest torque of the worst axis,
median. The vehicle that is not rigid carries a ring that unfolds in one attitude, and so adds inertia about yaw there:

    D33(q) = rigid + 0.3 kg m^2 exp(sharpness (cos(roll - 1) + cos(pitch - 2) - 2)).

Partitions are equidistant, or where it says so searched for and chosen on three noisy flights kept for it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np

from benchmarks.shared.full_circle import (
    PAPER,
    judged,
    optimised_flight,
    random_flight,
    searched,
    uniform_model,
    with_noise,
)
from cpfls_cli.identification.data import TorqueData, joined
from cpfls_cli.identification.judge import fit_baselines
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.motion import Motion

NOISE = (0.0, 0.01, 0.05)
SHARPNESS = {"rigid": None, "broad ring (sharpness 1)": 1.0, "narrow ring (sharpness 6)": 6.0}
ADDED, PLACE = 0.3, (1.0, 2.0)
SEARCH = {"population": 10, "generations": 4}
RULES = {
    "seesaw, 5 functions": vars(PAPER),
    "seesaw, 5 functions, searched": {**vars(PAPER), **SEARCH},
    "harmonic 1 tensor, 3 functions": {"harmonic_order": 1, "membership_functions": 3},
    "harmonic 1 tensor, 3 functions, searched": {"harmonic_order": 1, "membership_functions": 3, **SEARCH},
    "harmonic 1 tensor, 5 functions": {"harmonic_order": 1, "membership_functions": 5},
    "harmonic 2 tensor, 1 function": {},
    "harmonic 2 tensor, 3 functions": {"membership_functions": 3},
    "harmonic 4 tensor, 1 function": {"harmonic_order": 4},
}


def main() -> None:
    flights = (optimised_flight(PAPER), [random_flight(s) for s in range(200, 203)], unseen())
    for vehicle, sharpness in SHARPNESS.items():
        training, kept, judging = (changed(part, ring(sharpness)) for part in flights)
        print(f"\n{vehicle}:\n")
        rows = [(name, *errors(name, training, kept, judging)) for name in ("rigid-body", "constant-inertia")]
        for base in ("none", "rigid-body"):
            for name, keys in RULES.items():
                settings = IdentificationSettings(**keys, base=base)
                rows.append((f"{name}, base {base}", *errors(settings, training, kept, judging)))
        name = f"full_circle_noise_{vehicle.split()[0]}"
        table(name, ("model", *(f"noise {share:.0%}" for share in NOISE)), rows)


def unseen() -> list[TorqueData]:
    return [random_flight(seed) for seed in range(100, 108)]


def errors(model: IdentificationSettings | str, training: TorqueData, kept, judging) -> list[str]:
    """Median of the largest relative errors, by noise."""
    found = []
    for share in NOISE:
        rng = np.random.default_rng(7)
        noisy, choosing = with_noise(training, share, rng), joined([with_noise(one, share, rng) for one in kept])
        torque = fitted(model, noisy, choosing)
        found.append(f"{np.median(judged(torque, judging).largest):.2g}")
    return found


def fitted(model: IdentificationSettings | str, training: TorqueData, kept) -> Callable[[Motion], np.ndarray]:
    if isinstance(model, str):
        return next(baseline for baseline in fit_baselines(training, np.ones(3), 1e-9) if baseline.name == model).torque
    if model.population != SEARCH["population"]:
        return uniform_model(training, model).model.torque
    return searched(training, model, kept).held_out.model.torque


def ring(sharpness: float | None) -> Callable[[Motion], np.ndarray]:
    """Torque of an inertia about yaw that depends on roll and pitch, by the Christoffel symbols."""

    def torque(motion: Motion) -> np.ndarray:
        total = np.zeros_like(motion.attitude)
        if sharpness is None:
            return total
        away = motion.attitude[:, :2] - PLACE
        inertia = ADDED * np.exp(sharpness * (np.sum(np.cos(away), axis=1) - 2))
        gradient = -sharpness * np.sin(away) * inertia[:, None]
        yaw_rate = motion.rate[:, 2]
        total[:, 2] = inertia * motion.acceleration[:, 2] + np.sum(gradient * motion.rate[:, :2], axis=1) * yaw_rate
        total[:, :2] = -0.5 * gradient * yaw_rate[:, None] ** 2
        return total

    return torque


def changed(flight, added: Callable[[Motion], np.ndarray]):
    """Add a torque to one flight, or to each of several."""
    if isinstance(flight, list):
        return [changed(one, added) for one in flight]
    return replace(flight, torque=flight.torque + added(flight.motion))


if __name__ == "__main__":
    main()
