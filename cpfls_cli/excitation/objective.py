"""What an optimised path minimises: the conditioning of the regressor, with a penalty beyond the limits."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.excitation.conditioning import conditioning, regressor_of
from cpfls_cli.excitation.motion_gradient import motion_gradient
from cpfls_cli.excitation.regressor_gradient import regressor_gradient
from cpfls_cli.excitation.variables import design
from cpfls_cli.regressor import ModelStructure
from cpfls_cli.trajectory.rotation import RotationLimits, RotationMotion, RotationPath

# In the course of the descent: from all eigenvalues to the extremes, and from limits that give way to hard ones.
_EXPONENTS, _COSTS = (1.0, 16.0), (100.0, 3000.0)
# Share of a limit from which on it costs.
_FREE_SHARE = 0.98
_LOAD_STEP = 1e-4


class Objective:
    """Gradient of the smoothed condition number and the penalty, by the design variables.

    Each evaluation samples the path anew, shifted by a random part of the time between two samples: what lies between
    samples counts too, on average.

    Parameters
    ----------
    path : RotationPath
        Gives turns, harmonics and duration.
    structure : ModelStructure
    limits : RotationLimits
    samples : int
    iterations : int
        Evaluations in all, over which the exponent of the smoothed condition number and the cost of the penalty grow.
    rng : numpy.random.Generator

    Attributes
    ----------
    history : list of float
        Condition number at each evaluation.
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
    """Differentiate the smoothed condition number F of Q by the motion, ``2 <Q dF/dG, dQ>``.

    Parameters
    ----------
    structure : ModelStructure
    motion : array, shape (3, samples, 3)
        Attitude, Euler rates, Euler accelerations.
    exponent : float
        Of `conditioning`.

    Returns
    -------
    condition_number : float
    gradient : array, shape (3, samples, 3)
    """
    Q = regressor_of(structure, motion)
    rows = Q.reshape(-1, structure.parameters)
    reached = conditioning(rows.T @ rows, exponent)
    weights = 2 * (rows @ reached.slope).reshape(Q.shape)
    return reached.condition_number, regressor_gradient(structure, motion, weights)


def penalty_gradient(limits: RotationLimits, motion: Array, cost: float) -> Array:
    """Differentiate the mean square of what exceeds the limits by the motion.

    Parameters
    ----------
    limits : RotationLimits
    motion : array, shape (3, samples, 3)
    cost : float
        Of a limit exceeded twofold, all the time.

    Returns
    -------
    array, shape (3, samples, 3)
    """
    loads = limits.loads(RotationMotion(*motion))
    excess = np.sign(loads) * np.maximum(np.abs(loads) - _FREE_SHARE, 0.0)
    weights = 2 * cost / len(loads) * excess
    return motion_gradient(lambda moved: limits.loads(RotationMotion(*moved)), motion, weights, _LOAD_STEP)
