"""Data over the whole circle of roll and pitch, in memory, and models of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
from cpfls_cli.dynamics.rigid_body import newton_euler_torque
from cpfls_cli.excitation.optimise import optimised_rotation
from cpfls_cli.identification.data import TorqueData, TorqueSource
from cpfls_cli.identification.evaluator import Evaluator, decode, uniform_chromosome
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.judge import score_of
from cpfls_cli.identification.search import choose, search
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.structure import StructureSettings
from cpfls_cli.trajectory.rotation import RotationPath, full_rotation
from cpfls_cli.trajectory.settings import RotationSettings
from cpfls_cli.vehicle.settings import VehicleSettings

CONFIG = Path(__file__).resolve().parents[2] / "configs" / "full-circle.yaml"
PAPER = StructureSettings(consequents="seesaw", products="additive", membership_functions=5)
"""The structure of the paper: 113 parameters."""

INERTIA = np.diag([0.6, 0.6, 1.2])
"""Of the paper's vehicle, kg m^2."""

DURATION_S, SAMPLES = 54.86, 5487
_NOWHERE = np.zeros((0, 0), dtype=bool)


@dataclass(frozen=True)
class Judged:
    """What a model misses on flights that it never learned from; each is a share of that flight's own torque.

    Attributes
    ----------
    largest : array, shape (flights,)
        Largest error over largest torque, of the worst axis.
    rms : float
        Median root mean square of the error over that of the torque, all axes together.
    """

    largest: Array
    rms: float

    def __str__(self) -> str:
        return f"{np.median(self.largest):.2g} ({self.largest.max():.2g})"


def torque_data(motion: Motion, inertia: Array) -> TorqueData:
    """Drive a rigid body along a motion."""
    return TorqueData(0.01 * np.arange(len(motion)), motion, newton_euler_torque(*vars(motion).values(), inertia))


def random_states(seed: int, count: int = 6000) -> TorqueData:
    """Draw attitudes over the whole circle, rates up to 3 rad/s and accelerations up to 6 rad/s^2."""
    rng = np.random.default_rng(seed)
    states = (rng.uniform(-1, 1, (count, 3)) * limit for limit in (np.pi, 3.0, 6.0))
    return torque_data(Motion(*states), INERTIA)


def flown(path: RotationPath, inertia: Array = INERTIA) -> TorqueData:
    """Fly a path of rotations."""
    return torque_data(Motion(*vars(path.sample(path.times(SAMPLES))).values()), inertia)


def random_flight(seed: int, inertia: Array = INERTIA) -> TorqueData:
    """Fly a random full-rotation path with the program's own limits."""
    return flown(full_rotation(RotationSettings(), DURATION_S, np.random.default_rng(seed)), inertia)


def optimised_flight(structure: StructureSettings, seed: int = 1) -> TorqueData:
    """Fly the path that conditions a structure best, with the program's own limits."""
    rng = np.random.default_rng(seed)
    return flown(optimised_rotation(RotationSettings(), DURATION_S, structure, VehicleSettings(), rng).path)


@dataclass(frozen=True)
class Solved:
    """A model with what its system was worth."""

    model: InertiaFunctions
    rank: int
    condition_number: float


@dataclass(frozen=True)
class Searched:
    """One search, and three models of it."""

    uniform: Solved
    by_objectives: Solved
    held_out: Solved
    evaluations: int
    seconds: float


def solved(evaluator: Evaluator, chromosome: Array) -> Solved:
    """Solve a chromosome."""
    fit, learned = evaluator.fit(chromosome), evaluator.solver.learned
    assert fit is not None
    partitions = decode(learned.structure, chromosome.astype(float))
    exact, system = evaluator.solver.exact(partitions, fit)
    model = InertiaFunctions(
        learned.structure, learned.ranges, partitions, exact.coefficients, exact.rigid_body, _NOWHERE
    )
    return Solved(model, system.rank, system.condition_number)


def uniform_model(training: TorqueSource, settings: IdentificationSettings) -> Solved:
    """Fit a model with equidistant partitions."""
    evaluator = model_evaluator(training, training, settings)
    return solved(evaluator, uniform_chromosome(evaluator.structure))


def searched(training: TorqueSource, settings: IdentificationSettings, kept: TorqueSource, seed: int = 1) -> Searched:
    """Search for partitions; choose by the default rule, and on flights kept for it."""
    evaluator, begin = model_evaluator(training, training, settings), time.perf_counter()
    by_held_out = replace(settings, choice="held-out")
    found = search(evaluator, by_held_out, np.random.default_rng(seed), kept=kept)
    seconds, front = time.perf_counter() - begin, found.front
    by_objectives = choose(front.objectives, "mse-below-median-condition")
    members = (uniform_chromosome(evaluator.structure), *front.chromosomes[[by_objectives, front.chosen]])
    return Searched(*(solved(evaluator, member) for member in members), int(found.history.evaluations[-1]), seconds)


def judged(torque: Callable[[Motion], Array], flights: Sequence[TorqueData]) -> Judged:
    """Judge predictions of torque on several flights."""
    scores = [score_of(flight, torque) for flight in flights]
    squares = [np.mean(flight.torque**2) for flight in flights]
    rms = [np.sqrt(np.mean(score.mse) / square) for score, square in zip(scores, squares, strict=True)]
    return Judged(np.array([score.worst_relative_error for score in scores]), float(np.median(rms)))
