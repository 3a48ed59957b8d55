"""Condition number of a regressor, and a smooth function that comes close to its logarithm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.regressor import ModelStructure, Motion, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.trajectory.rotation import RotationPath

# Share of the largest eigenvalue below which an eigenvalue of a Gram matrix is rounding error.
_ROUNDING = 1e-15


@dataclass(frozen=True)
class Conditioning:
    """How well a Gram matrix is conditioned.

    Attributes
    ----------
    condition_number : float
        Of the regressor, the root of that of its Gram matrix.
    smoothed : float
        See `conditioning`.
    slope : array, shape (parameters, parameters)
        Derivative of `smoothed` by the Gram matrix.
    """

    condition_number: float
    smoothed: float
    slope: Array


def conditioning(gram: Array, exponent: float) -> Conditioning:
    """Bound the logarithm of the condition number by a function without kinks.

    ``(log tr G^p + log tr G^-p) / 2p``, which falls to the logarithm of the condition number as p grows.

    Parameters
    ----------
    gram : array, shape (parameters, parameters)
        ``G = Q^T Q``.
    exponent : float
        p; one weighs all eigenvalues (the A criterion of design), a large one only the extremes (the K criterion).

    References
    ----------
    Pukelsheim (1993), Optimal Design of Experiments, chapter 6: matrix means.
    """
    eigenvalues, vectors = np.linalg.eigh(gram)
    values = np.maximum(eigenvalues, _ROUNDING * eigenvalues[-1])
    large, small = (values / values[-1]) ** exponent, (values[0] / values) ** exponent
    spread = values[-1] / values[0]
    smoothed = 0.5 * (np.log(spread) + (np.log(large.sum()) + np.log(small.sum())) / exponent)
    weights = 0.5 * (large / large.sum() - small / small.sum()) / values
    return Conditioning(float(np.sqrt(spread)), float(smoothed), (vectors * weights) @ vectors.T)


def regressor_of(structure: ModelStructure, motion: Array) -> Array:
    """Build Q of a motion for uniform partitions.

    Parameters
    ----------
    structure : ModelStructure
    motion : array, shape (3, samples, 3)
        Attitude, Euler rates, Euler accelerations.

    Returns
    -------
    array, shape (samples, 3, parameters)
    """
    ranges = data_ranges(structure, motion[0])
    return Regressor(structure, Motion(*motion), ranges).matrix(uniform_breakpoints(structure))


def condition_number(path: RotationPath, structure: ModelStructure, samples: int) -> float:
    """Find the condition number of the regressor along a path.

    Parameters
    ----------
    path : RotationPath
    structure : ModelStructure
        Its partitions are taken to be uniform.
    samples : int
        At equal times over the duration.

    Returns
    -------
    float
        1e15 and more where the path does not excite all parameters.
    """
    motion = path.sample(path.times(samples))
    Q = regressor_of(structure, np.stack([motion.attitude, motion.attitude_rate, motion.attitude_acceleration]))
    # The Gram matrix would lose what is below 1e-8 of the largest singular value.
    return float(np.linalg.cond(np.linalg.qr(Q.reshape(-1, structure.parameters), mode="r")))
