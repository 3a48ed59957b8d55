"""Gradient, by the motion at each sample, of a weighted sum over the regressor."""

from __future__ import annotations

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.excitation.conditioning import regressor_of
from cpfls_cli.excitation.motion_gradient import motion_gradient
from cpfls_cli.regressor import ModelStructure, Motion, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import PITCH, ROLL, Block, InertiaFunction

# The slopes of membership functions and of the triangle wave have kinks and jumps; a wide step, in rad, smooths them.
_STEP = 0.1
_ATTITUDE, _RATE, _ACCELERATION = range(3)


def regressor_gradient(structure: ModelStructure, motion: Array, weights: Array) -> Array:
    """Differentiate ``sum_n <weights_n, Q(motion_n)>``: by rates and accelerations exactly, by attitude by differences.

    Parameters
    ----------
    structure : ModelStructure
        Its partitions are taken to be uniform.
    motion : array, shape (3, samples, 3)
        Attitude, Euler rates, Euler accelerations.
    weights : array, shape (samples, 3, parameters)

    Returns
    -------
    array, shape (3, samples, 3)

    References
    ----------
    method.md section 2: ``tau = J qdd + (dJ/dt) qd - 1/2 grad_q (qd^T J qd)``.
    """
    inputs = (_ATTITUDE, ROLL), (_ATTITUDE, PITCH)
    gradient = motion_gradient(lambda moved: regressor_of(structure, moved), motion, weights, _STEP, inputs)
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
