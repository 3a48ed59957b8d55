"""Optimal excitation: a path of full rotations that conditions the parameters of a model best, found by Adam."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.excitation.objective import Objective, condition_number, path_of, variables_of
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.rounding import at_most, levelled
from cpfls_cli.trajectory.rotation import RotationLimits, RotationPath, full_rotation
from cpfls_cli.trajectory.settings import RotationSettings
from cpfls_cli.vehicle.settings import VehicleSettings

Progress = Callable[[int, int, str], None]

# Samples of a path during the search: the most of these; and how many times as many judge the result.
_SAMPLES, _SAMPLES_PER_PARAMETER, _SAMPLES_PER_SECOND = 500, 2, 8
_FINER = 10
# Of each design variable, in rad or rad/s.
_STEP = 0.05
# Of Adam: share of the mean and of the mean square of the gradient that is kept; what keeps it from dividing by zero.
_MEMORY, _SQUARE_MEMORY = 0.9, 0.99
_SMALL = 1e-12


@dataclass(frozen=True)
class Excitation:
    """An optimised path, its condition number, and the course of the search.

    Attributes
    ----------
    condition_number : float
        Of the regressor along the path.
    random : array, shape (starts,)
        Condition numbers along the random paths; the best of them was improved.
    history : array, shape (iterations,)
        Condition numbers in the course of the search, on few samples and before the limits are enforced.
    """

    path: RotationPath
    condition_number: float
    random: Array
    history: Array

    @property
    def evaluations(self) -> int:
        """Number of random paths and iterations."""
        return len(self.random) + len(self.history)


def optimised_rotation(
    settings: RotationSettings,
    duration: float,
    structure_settings: StructureSettings,
    vehicle: VehicleSettings,
    rng: np.random.Generator,
    progress: Progress | None = None,
) -> Excitation:
    """Choose a path that minimises the condition number of the regressor Q.

    The best of some random paths is improved by stochastic gradient descent.

    Parameters
    ----------
    duration : float, s
    structure_settings : StructureSettings
        Model whose regressor is meant, with uniform partitions.
    vehicle : VehicleSettings
        Its inertia turns accelerations into torques, where the torque is limited.
    progress : callable, optional
        Called with the paths and iterations done, their final number, and a word on what was reached.

    Raises
    ------
    SettingError
        If the limits do not leave room for the turns, or no harmonic fits into the duration.

    References
    ----------
    Swevers et al. (1997), Optimal robot excitation and identification, IEEE Transactions on Robotics and Automation
    13(5).
    """
    structure, limits = model_structure(structure_settings), RotationLimits(settings, vehicle.inertia_kg_m2)
    samples = max(_SAMPLES, _SAMPLES_PER_PARAMETER * structure.parameters, round(_SAMPLES_PER_SECOND * duration))
    report = _Report(progress, settings.starts + settings.iterations)
    paths = [full_rotation(settings, duration, rng, vehicle.inertia_kg_m2) for _ in range(settings.starts)]
    random = [report(condition_number(path, structure, samples)) for path in paths]
    path = best = paths[int(np.argmin(levelled(np.array(random))))]
    objective = Objective(best, structure, limits, samples, settings.iterations, rng)
    for variables in adam(objective.gradient, variables_of(best), settings.iterations, _STEP):
        report(objective.history[-1])
        path = path_of(variables, best)
    # Enforced limits may cost a path what it had gained.
    path = limits.enforced(path)
    reached, before = (condition_number(either, structure, _FINER * samples) for either in (path, best))
    if not at_most(reached, before):
        reached, path = before, best
    return Excitation(path, reached, np.array(random), np.array(objective.history))


class _Report:
    """Count evaluations, and report the condition number that each reached."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress, self._total, self._done = progress, total, 0

    def __call__(self, condition_number: float) -> float:
        self._done += 1
        if self._progress is not None:
            self._progress(self._done, self._total, f"condition number {condition_number:.3g}")
        return condition_number


def adam(gradient: Callable[[Array], Array], start: Array, iterations: int, step: float) -> Iterator[Array]:
    """Descend by Adam with a step that falls to zero along half a cosine; the gradient has noise of mean zero.

    Kingma & Ba (2015), Adam: a method for stochastic optimization, ICLR. Loshchilov & Hutter (2017), SGDR, ICLR, for
    the cosine.
    """
    variables = start.copy()
    mean, square = np.zeros_like(start), np.zeros_like(start)
    for iteration in range(1, iterations + 1):
        slope = gradient(variables)
        mean = _MEMORY * mean + (1 - _MEMORY) * slope
        square = _SQUARE_MEMORY * square + (1 - _SQUARE_MEMORY) * slope**2
        unbiased = mean / (1 - _MEMORY**iteration)
        size = np.sqrt(square / (1 - _SQUARE_MEMORY**iteration)) + _SMALL
        falling = 0.5 * (1 + np.cos(np.pi * (iteration - 1) / iterations))
        variables = variables - step * falling * unbiased / size
        yield variables
