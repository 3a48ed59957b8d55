"""Gradient, by the motion at each sample, of a sum over what depends on that sample alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cpfls_cli.arrays import Array


def motion_gradient(
    function: Callable[[Array], Array], motion: Array, weights: Array, steps: tuple[float, float, float]
) -> Array:
    """Differentiate ``sum_n <weights_n, f(motion_n)>`` by central differences.

    What is quadratic in an input has no error from the size of its step. A kink or jump is smoothed over the step, so
    that its share in the slope is not lost between samples.

    Parameters
    ----------
    function : callable
        Takes a motion, shape (3, samples, 3), to values of shape (samples, ...), sample by sample.
    motion : array, shape (3, samples, 3)
        Attitude, Euler rates, Euler accelerations.
    weights : array, shape (samples, ...)
    steps : tuple of float
        Of attitude in rad, of rate in rad/s, of acceleration in rad/s^2.

    Returns
    -------
    array, shape (3, samples, 3)
    """
    gradient, flat = np.zeros_like(motion), weights.reshape(len(weights), -1)
    for kind, step in enumerate(steps):
        for axis in range(3):
            shift = np.zeros_like(motion)
            shift[kind, :, axis] = step
            difference = function(motion + shift) - function(motion - shift)
            gradient[kind, :, axis] = np.einsum("ni,ni->n", flat, difference.reshape(flat.shape)) / (2 * step)
    return gradient
