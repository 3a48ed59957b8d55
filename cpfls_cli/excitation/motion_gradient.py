"""Gradient, by the motion at each sample, of a sum over what depends on that sample alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from cpfls_cli.arrays import Array

ALL_INPUTS = tuple(product(range(3), range(3)))
"""Every component of attitude, rate and acceleration."""


def motion_gradient(
    function: Callable[[Array], Array],
    motion: Array,
    weights: Array,
    step: float,
    inputs: Sequence[tuple[int, int]] = ALL_INPUTS,
) -> Array:
    """Differentiate ``sum_n <weights_n, f(motion_n)>`` by central differences.

    A jump is smoothed over the step, so that its share in the slope is not lost between samples.

    Parameters
    ----------
    function : callable
        Takes a motion, shape (3, samples, 3), to values of shape (samples, ...), sample by sample.
    motion : array, shape (3, samples, 3)
        Attitude, Euler rates, Euler accelerations.
    weights : array, shape (samples, ...)
    step : float, rad and s
    inputs : sequence of pairs of int
        Index of attitude, rate or acceleration, and of the axis.

    Returns
    -------
    array, shape (3, samples, 3)
        Zero for the inputs that are left out.
    """
    gradient, flat = np.zeros_like(motion), weights.reshape(len(weights), -1)
    for kind, axis in inputs:
        shift = np.zeros_like(motion)
        shift[kind, :, axis] = step
        difference = function(motion + shift) - function(motion - shift)
        gradient[kind, :, axis] = np.einsum("ni,ni->n", flat, difference.reshape(flat.shape)) / (2 * step)
    return gradient
