"""How often bands of 95 % hold the truth, in 200 simulated flights.

Each flight has the same motion and new noise, 5 % of each torque's root mean square: white, or coloured (first-order
autoregressive, time constant 5 samples). Bands are those of `cpfls identify`: 40 blocks, 200 draws. They are asked for
D_ij(q) at 100 attitudes of the flight, and for the six parameters of the rigid body that fits best.

The truth is the vehicle, which harmonics up to the second order contain. The structure of the paper does not: its
flights have the torque of that structure fitted to the vehicle, which then is the truth, but for one line with the
vehicle's own. The rigid body's truth is the rigid body that fits best without noise.

Flights of small angles have a vehicle that is no rigid body, and a ridge that pulls towards one: bands are asked for
where they flew, and at rolls of 60 to 120 degrees, which they never saw.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import signal

from benchmarks.shared.measure import program, table
from benchmarks.shared.studies import paper_flight, paper_selection, paper_study
from cpfls_cli.arrays import Array
from cpfls_cli.dynamics import InertiaFunctions, inertia_matrix, newton_euler_torque
from cpfls_cli.identification.data import TorqueData, axis_scale
from cpfls_cli.identification.evaluator import decode, uniform_chromosome
from cpfls_cli.identification.findings import fit_baselines
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.inertia import INERTIA_ENTRIES, symmetric
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.trajectory.rotation import full_rotation
from cpfls_cli.trajectory.settings import RotationSettings
from cpfls_cli.validation.bands import band, bootstrap, inertia_band

NOISE, TIME_CONSTANT, ATTITUDES = 0.05, 5.0, 100
INERTIA, DURATION_S, SAMPLES = np.diag([0.6, 0.6, 1.2]), 54.86, 5487
BENT = 0.3
NOWHERE = np.zeros((72, 72), dtype=bool)


@dataclass(frozen=True)
class Case:
    """A flight without noise, what is learned from it, and the truth of its inertia at attitudes."""

    name: str
    flight: TorqueData
    learned: np.ndarray
    settings: IdentificationSettings
    truth: Callable[[Array], Array] | None = None
    elsewhere: Array | None = None

    @property
    def attitude(self) -> Array:
        """Attitudes that are asked for: of the flight, unless others are."""
        if self.elsewhere is not None:
            return self.elsewhere
        return self.flight.motion.attitude[np.linspace(0, len(self.flight) - 1, ATTITUDES).astype(int)]

    def fitted(self, torque: Array) -> tuple:
        """Fit equidistant partitions: evaluator, training part, model, fit."""
        training = replace(self.flight, torque=torque)
        evaluator = model_evaluator(training, training[self.learned], self.settings)
        learned, chromosome = evaluator.solver.learned, uniform_chromosome(evaluator.structure)
        fit = evaluator.fit(chromosome)
        partitions = decode(learned.structure, chromosome.astype(float))
        model = InertiaFunctions(
            learned.structure, learned.ranges, partitions, fit.coefficients, fit.rigid_body, NOWHERE
        )
        return evaluator, training, model, fit

    def inertia(self) -> Array:
        """Give the true inertia at the attitudes."""
        if self.truth is not None:
            return self.truth(self.attitude)
        return self.fitted(self.flight.torque)[2].inertia(self.attitude).value

    def best(self, torque: Array, row_scale: Array) -> Array:
        """Fit a rigid body."""
        learned = replace(self.flight, torque=torque)[self.learned]
        return fit_baselines(learned, row_scale, self.settings.rank_tolerance)[0].parameters


def cases() -> list[Case]:
    paper, path = paper_study().identification, paper_flight()
    rotation = full_rotation(RotationSettings(), DURATION_S, np.random.default_rng(200))
    turning = rigid(Motion(*vars(rotation.sample(rotation.times(SAMPLES))).values()))
    every, selected = np.arange(len(path)), np.searchsorted(path.time, paper_selection().time)
    bent = replace(turning, torque=turning.torque + bent_torque(turning))
    alone, held = IdentificationSettings(base="none"), IdentificationSettings()
    itself = replace(path, torque=Case("", path, every, paper).fitted(path.torque)[2].torque(path.motion))
    return [
        Case("paper's structure, its path, 5487 samples", itself, every, paper),
        Case("the same, 685 samples selected", itself, selected, paper),
        Case("the same, torque of the vehicle", path, selected, paper, vehicle),
        Case("harmonic 2, no rigid body below, full rotations", turning, every, alone, vehicle),
        Case("harmonic 2 over a rigid body, full rotations", turning, every, held, vehicle),
        Case("the same, vehicle not rigid", bent, every, held, bent_vehicle),
        *small_angles(),
    ]


def small_angles() -> list[Case]:
    """Flights that tilt less and less of a circle, of a vehicle that is no rigid body."""
    held, found, far = IdentificationSettings(), [], np.zeros((ATTITUDES, 3))
    far[:, 0] = np.deg2rad(np.linspace(60.0, 120.0, ATTITUDES))
    for tilt in (13, 26, 45):
        flight = tilted(np.deg2rad(tilt))
        flight, every = replace(flight, torque=flight.torque + bent_torque(flight)), np.arange(len(flight))
        found.append(Case(f"tilt up to {tilt} degrees, vehicle not rigid", flight, every, held, bent_vehicle))
        found.append(Case("the same, at attitudes not visited", flight, every, held, bent_vehicle, far))
    return found


def tilted(largest: float) -> TorqueData:
    """Fly 24 s of five sines about each axis, roll and pitch up to an angle in rad, with the rigid vehicle's torque."""
    rng, time = np.random.default_rng(11), 0.01 * np.arange(2400)
    frequency, phase = rng.uniform(2.0, 9.0, (5, 3)), rng.uniform(0.0, 2.0 * np.pi, (5, 3))
    amplitude = rng.uniform(0.3, 1.0, (5, 3))
    angle = frequency * time[:, None, None] + phase
    attitude, rate, acceleration = (
        np.sum(amplitude * frequency**order * np.sin(angle + 0.5 * np.pi * order), axis=1) for order in range(3)
    )
    size = largest / np.max(np.abs(attitude[:, :2]))
    return rigid(Motion(size * attitude, size * rate, size * acceleration))


def rigid(motion: Motion) -> TorqueData:
    """Drive the rigid vehicle along a motion."""
    return TorqueData(0.01 * np.arange(len(motion)), motion, newton_euler_torque(*vars(motion).values(), INERTIA))


def vehicle(attitude: Array) -> Array:
    return inertia_matrix(attitude, symmetric([*np.diag(INERTIA)]))


def bent_vehicle(attitude: Array) -> Array:
    return vehicle(attitude) + bent_inertia(attitude)


def bent_inertia(attitude: Array) -> Array:
    """Add 0.3 cos(roll) to D22."""
    added = np.zeros((len(attitude), 3, 3))
    added[:, 1, 1] = BENT * np.cos(attitude[:, 0])
    return added


def bent_torque(flight: TorqueData) -> Array:
    """Work out the torque of that from its Lagrangian, L = f(roll) pitch_rate^2 / 2."""
    motion = flight.motion
    f, slope = BENT * np.cos(motion.attitude[:, 0]), -BENT * np.sin(motion.attitude[:, 0])
    pitch = f * motion.acceleration[:, 1] + slope * motion.rate[:, 0] * motion.rate[:, 1]
    return np.column_stack([-0.5 * slope * motion.rate[:, 1] ** 2, pitch, np.zeros(len(flight))])


def noise(rng: np.random.Generator, samples: int, coloured: bool) -> Array:
    """Draw noise of unit variance."""
    keep = np.exp(-1.0 / TIME_CONSTANT) if coloured else 0.0
    settle = int(20 * TIME_CONSTANT)
    white = rng.standard_normal((settle + samples, 3))
    return signal.lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], white, axis=0)[settle:]


def coverage(case: Case, coloured: bool, runs: int, seed: int) -> tuple:
    """Count how often the bands hold the truth: by entry of the inertia matrix, and by rigid-body parameter."""
    rng, truth = np.random.default_rng(seed), case.inertia()
    strength = NOISE * axis_scale(case.flight)
    inside, held, weights = [], [], []
    for _ in range(runs):
        torque = case.flight.torque + strength * noise(rng, len(case.flight), coloured)
        evaluator, training, model, fit = case.fitted(torque)
        draws = bootstrap(evaluator, training, model, fit, case.settings.validation, rng)
        low, high = inertia_band(model, draws, case.attitude)
        inside.append((low <= truth) & (truth <= high))
        best_truth, best = (case.best(t, fit.row_scale) for t in (case.flight.torque, torque))
        low, high = band(best, draws.best_rigid_body, draws.blocks)
        held.append((low <= best_truth) & (best_truth <= high))
        weights.append(fit.ridge_weight)
    by_entry = np.mean(inside, axis=(0, 1))
    entries = np.array(
        [by_entry[place] for place in INERTIA_ENTRIES if np.any(truth[:, *place] != 0) or case.settings.base != "none"]
    )
    return entries, np.mean(held, axis=0), np.min(np.mean(inside, axis=0)), np.median(weights)


def main(runs: int = 200, seed: int = 2027) -> None:
    rows = []
    for case in cases():
        for noise in ("white", "coloured"):
            entries, held, lowest, weight = coverage(case, noise == "coloured", runs, seed)
            rows.append((case.name, noise, weight, *map(percent, (entries, [lowest], held))))
    columns = "model | noise | median ridge weight | D_ij, mean (by entry) | worst D_ij(q) | rigid body"
    table("coverage", columns, rows, runs=runs, seed=seed)


def percent(shares) -> str:
    """Write shares as per cent: the mean, and the smallest and largest where there are several."""
    values = 100 * np.asarray(shares)
    return f"{values.mean():.1f}" + (f" ({values.min():.1f} to {values.max():.1f})" if len(values) > 1 else "")


if __name__ == "__main__":
    program(main)
