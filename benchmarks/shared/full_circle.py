"""Data over the whole circle of roll and pitch, in memory, and models of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.chromosome import decode, uniform_chromosome
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import Evaluator
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.judge import score_of
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor import Motion
from cpfls_cli.trajectory.rotation import RotationPath, full_rotation
from cpfls_cli.trajectory.rotation_settings import RotationSettings
from cpfls_cli.vehicle import newton_euler_torque

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
    root_mean_square : array, shape (flights,)
        Root mean square of the error over that of the torque, all axes together.
    """

    largest: Array
    root_mean_square: Array

    def __str__(self) -> str:
        return f"{np.median(self.largest):.3g} ({self.largest.max():.3g})"


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


def solved_model(evaluator: Evaluator, chromosome: Array) -> Model:
    """Solve a chromosome."""
    fit, learned = evaluator.fit(chromosome), evaluator.solver.learned
    assert fit is not None
    partitions = decode(learned.structure, chromosome.astype(float))
    exact, _ = evaluator.solver.exact(partitions, fit)
    return Model(learned.structure, learned.ranges, partitions, exact.coefficients, exact.rigid_body, _NOWHERE)


def uniform_model(training: TorqueData, settings: IdentificationSettings) -> Model:
    """Fit a model with equidistant partitions."""
    evaluator = model_evaluator(training, training, settings)
    return solved_model(evaluator, uniform_chromosome(evaluator.structure))


def judged(torque, flights: Sequence[TorqueData]) -> Judged:
    """Judge predictions of torque on several flights."""
    scores = [score_of(flight, torque) for flight in flights]
    squares = [np.mean(flight.torque**2) for flight in flights]
    return Judged(
        np.array([score.worst_relative_error for score in scores]),
        np.array([np.sqrt(np.mean(score.mse) / square) for score, square in zip(scores, squares, strict=True)]),
    )
