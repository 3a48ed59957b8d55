"""Paths that identify well: what an optimised one minimises, with its gradient, and how it is found."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count, product

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.regressor.regressor import Motion, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import (
    PITCH,
    ROLL,
    Block,
    InertiaFunction,
    ModelStructure,
    StructureSettings,
    model_structure,
)
from cpfls_cli.rounding import at_most, levelled
from cpfls_cli.trajectory.rotation import RotationLimits, RotationMotion, RotationPath, full_rotation
from cpfls_cli.trajectory.settings import RotationSettings
from cpfls_cli.vehicle.settings import VehicleSettings


@dataclass(frozen=True)
class Design:
    """Motion at some times as a linear function of the design variables.

    `matrices`: by attitude, rate and acceleration, shape (3, time, variables per angle); `turning`: part of the motion
    that the turns give, shape (3, time, 3).
    """

    matrices: Array
    turning: Array

    def motion(self, variables: Array) -> Array:
        """Evaluate the motion.

        Parameters
        ----------
        variables : array, shape (3, variables per angle)

        Returns
        -------
        array, shape (3, time, 3), rad and s
            Attitude, Euler rates and Euler accelerations.
        """
        motion: Array = self.matrices @ variables.T + self.turning
        return motion

    def gradient(self, by_motion: Array) -> Array:
        """Carry a gradient by the motion back to the design variables.

        Parameters
        ----------
        by_motion : array, shape (3, time, 3)

        Returns
        -------
        array, shape (3, variables per angle)
        """
        gradient: Array = np.einsum("ktv,kta->av", self.matrices, by_motion, optimize=True)
        return gradient


def variables_of(path: RotationPath) -> Array:
    """Write a path as design variables of equal weight, shape (3, 1 + 2 harmonics).

    Start in rad, then the amplitudes of the rates of sine and cosine terms in rad/s.
    """
    return np.hstack([path.start[:, None], path.sine * path.frequency, path.cosine * path.frequency])


def path_of(variables: Array, like: RotationPath) -> RotationPath:
    """Read a path from design variables, with turns and duration of another."""
    sine, cosine = np.split(variables[:, 1:], 2, axis=1)
    return RotationPath(variables[:, 0], like.turns, sine / like.frequency, cosine / like.frequency, like.duration)


def design(like: RotationPath, time: Array) -> Design:
    """Build the linear map from design variables to the motion at some times, for the turns of a path."""
    frequency = like.frequency
    sine, cosine = np.sin(time[:, None] * frequency), np.cos(time[:, None] * frequency)
    one, zero = np.ones((len(time), 1)), np.zeros((len(time), 1))
    matrices = np.stack(
        [
            np.hstack([one, sine / frequency, cosine / frequency]),
            np.hstack([zero, cosine, -sine]),
            np.hstack([zero, -sine * frequency, -cosine * frequency]),
        ]
    )
    rate = 2 * np.pi / like.duration * like.turns
    turning = np.stack([time[:, None] * rate, np.broadcast_to(rate, (len(time), 3)), np.zeros((len(time), 3))])
    return Design(matrices, turning)


# Share of the largest eigenvalue below which an eigenvalue of a Gram matrix is rounding error.
_ROUNDING = 1e-15
# In the course of the descent: from all eigenvalues to the extremes, and from limits that give way to hard ones.
_EXPONENTS, _COSTS = (1.0, 16.0), (100.0, 3000.0)
# Share of a limit from which on it costs.
_FREE_SHARE = 0.98
_LOAD_STEP = 1e-4
# The slopes of membership functions and of the triangle wave have kinks and jumps; a wide step, in rad, smooths them.
_ATTITUDE_STEP = 0.1
_ATTITUDE, _RATE, _ACCELERATION = range(3)
ALL_INPUTS = tuple(product(range(3), range(3)))
"""Every component of attitude, rate and acceleration."""


@dataclass(frozen=True)
class Conditioning:
    """Conditioning of a Gram matrix: condition number of the regressor, smoothed, and its slope by the matrix."""

    condition_number: float
    smoothed: float
    slope: Array


def conditioning(gram: Array, exponent: float) -> Conditioning:
    """Bound the logarithm of the condition number of ``G = Q^T Q`` by a function without kinks.

    ``(log tr G^p + log tr G^-p) / 2p``, which falls to the logarithm of the condition number as the exponent p grows:
    one weighs all eigenvalues (the A criterion of design), a large one only the extremes (the K criterion). Pukelsheim
    (1993), Optimal Design of Experiments, chapter 6: matrix means.
    """
    eigenvalues, vectors = np.linalg.eigh(gram)
    values = np.maximum(eigenvalues, _ROUNDING * eigenvalues[-1])
    large, small = (values / values[-1]) ** exponent, (values[0] / values) ** exponent
    spread = values[-1] / values[0]
    smoothed = 0.5 * (np.log(spread) + (np.log(large.sum()) + np.log(small.sum())) / exponent)
    weights = 0.5 * (large / large.sum() - small / small.sum()) / values
    return Conditioning(float(np.sqrt(spread)), float(smoothed), (vectors * weights) @ vectors.T)


def regressor_of(structure: ModelStructure, motion: Array) -> Array:
    """Build Q of a motion for uniform partitions, shape (samples, 3, parameters).

    The motion is attitude, Euler rates, Euler accelerations, shape (3, samples, 3), as in all of this module.
    """
    ranges = data_ranges(structure, motion[0])
    return Regressor(structure, Motion(*motion), ranges).matrix(uniform_breakpoints(structure))


def condition_number(path: RotationPath, structure: ModelStructure, samples: int) -> float:
    """Find the condition number of the regressor along a path, at equal times, for uniform partitions.

    It is 1e15 and more where the path does not excite all parameters.
    """
    motion = path.sample(path.times(samples))
    Q = regressor_of(structure, np.stack([motion.attitude, motion.attitude_rate, motion.attitude_acceleration]))
    # The Gram matrix would lose what is below 1e-8 of the largest singular value.
    return float(np.linalg.cond(np.linalg.qr(Q.reshape(-1, structure.parameters), mode="r")))


class Objective:
    """Gradient of the smoothed condition number and the penalty, by the design variables.

    Each evaluation samples the path anew, shifted by a random part of the time between two samples: what lies between
    samples counts too, on average. Over all `iterations` the exponent of the smoothed condition number and the cost of
    the penalty grow; `history` is the condition number at each.
    """

    def __init__(
        self,
        path: RotationPath,
        structure: ModelStructure,
        limits: RotationLimits,
        samples: int,
        iterations: int,
        rng: np.random.Generator,
    ) -> None:
        self._path, self._structure, self._limits, self._rng = path, structure, limits, rng
        self._times = path.times(samples)
        self._exponents, self._costs = np.geomspace(*_EXPONENTS, iterations), np.geomspace(*_COSTS, iterations)
        self.history: list[float] = []

    def gradient(self, variables: Array) -> Array:
        """Differentiate by the design variables.

        Parameters
        ----------
        variables : array, shape (3, 1 + 2 harmonics)

        Returns
        -------
        array, shape (3, 1 + 2 harmonics)
        """
        shifted = design(self._path, self._times + self._rng.random() * self._times[1])
        motion = shifted.motion(variables)
        exponent, cost = float(self._exponents[len(self.history)]), float(self._costs[len(self.history)])
        reached, by_motion = conditioning_gradient(self._structure, motion, exponent)
        self.history.append(reached)
        return shifted.gradient(by_motion + penalty_gradient(self._limits, motion, cost))


def conditioning_gradient(structure: ModelStructure, motion: Array, exponent: float) -> tuple[float, Array]:
    """Differentiate the smoothed condition number F of Q by the motion, ``2 <Q dF/dG, dQ>``; gives the number too."""
    Q = regressor_of(structure, motion)
    rows = Q.reshape(-1, structure.parameters)
    reached = conditioning(rows.T @ rows, exponent)
    weights = 2 * (rows @ reached.slope).reshape(Q.shape)
    return reached.condition_number, regressor_gradient(structure, motion, weights)


def penalty_gradient(limits: RotationLimits, motion: Array, cost: float) -> Array:
    """Differentiate the mean square of the excess over the limits by the motion.

    `cost` is that of a limit exceeded twofold, all the time.
    """
    loads = limits.loads(RotationMotion(*motion))
    excess = np.sign(loads) * np.maximum(np.abs(loads) - _FREE_SHARE, 0.0)
    weights = 2 * cost / len(loads) * excess
    return motion_gradient(lambda moved: limits.loads(RotationMotion(*moved)), motion, weights, _LOAD_STEP)


def regressor_gradient(structure: ModelStructure, motion: Array, weights: Array) -> Array:
    """Differentiate ``sum_n <weights_n, Q(motion_n)>``: by rates and accelerations exactly, by attitude by differences.

    Partitions are taken to be uniform. method.md section 2: ``tau = J qdd + (dJ/dt) qd - 1/2 grad_q (qd^T J qd)``.
    """
    inputs = (_ATTITUDE, ROLL), (_ATTITUDE, PITCH)
    gradient = motion_gradient(lambda moved: regressor_of(structure, moved), motion, weights, _ATTITUDE_STEP, inputs)
    regressor = Regressor(structure, Motion(*motion), data_ranges(structure, motion[_ATTITUDE]))
    for index, block in enumerate(structure.blocks):
        places = _places(block.function)
        value, slopes = _weighted(regressor, index, block, weights[:, :, block.columns])
        momentum = motion[_RATE] @ places
        gradient[_ACCELERATION] += value @ places
        gradient[_RATE] += rotations.multiply(slopes, motion[_RATE]) @ places
        gradient[_RATE] += rotations.multiply(slopes.swapaxes(1, 2), momentum)
        gradient[_RATE] -= np.trace(slopes, axis1=1, axis2=2)[:, None] * momentum
    return gradient


def _weighted(regressor: Regressor, index: int, block: Block, weights: Array) -> tuple[Array, Array]:
    """Weighted sums of an inertia function's basis, (samples, 3), and of its slopes by each angle, (samples, 3, 3)."""
    basis = regressor.basis(index, uniform_breakpoints(regressor.structure))
    slopes = np.zeros((len(weights), 3, 3))
    for angle, slope in zip(block.function.inputs, basis.gradient, strict=True):
        slopes[:, :, angle] = rotations.multiply(weights, slope)
    return rotations.multiply(weights, basis.value), slopes


def _places(function: InertiaFunction) -> Array:
    """Symmetric matrix with ones in a function's places."""
    places = np.zeros((3, 3))
    places[function.row, function.column] = places[function.column, function.row] = 1.0
    return places


def motion_gradient(
    function: Callable[[Array], Array],
    motion: Array,
    weights: Array,
    step: float,
    inputs: Sequence[tuple[int, int]] = ALL_INPUTS,
) -> Array:
    """Differentiate ``sum_n <weights_n, f(motion_n)>`` by central differences; zero for inputs that are left out.

    A jump is smoothed over the step, so that its share in the slope is not lost between samples. An input is the index
    of attitude, rate or acceleration, and of the axis.
    """
    gradient, flat = np.zeros_like(motion), weights.reshape(len(weights), -1)
    for kind, axis in inputs:
        shift = np.zeros_like(motion)
        shift[kind, :, axis] = step
        difference = function(motion + shift) - function(motion - shift)
        gradient[kind, :, axis] = np.einsum("ni,ni->n", flat, difference.reshape(flat.shape)) / (2 * step)
    return gradient


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
    done, total = count(1), settings.starts + settings.iterations

    def report(reached: float) -> float:
        if progress is not None:
            progress(next(done), total, f"condition number {reached:.3g}")
        return reached

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
