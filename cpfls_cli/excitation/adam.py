"""Gradient descent with steps scaled by the gradient's own size, for gradients that carry noise."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from cpfls_cli.arrays import Array

_MEMORY, _SQUARE_MEMORY = 0.9, 0.99
_SMALL = 1e-12


def adam(gradient: Callable[[Array], Array], start: Array, iterations: int, step: float) -> Iterator[Array]:
    """Descend by Adam with a step that falls to zero along half a cosine.

    Parameters
    ----------
    gradient : callable
        Gradient at given variables, with noise of mean zero.
    start : array
    iterations : int
    step : float
        Of each variable, at the beginning.

    Yields
    ------
    array
        Variables after each iteration.

    References
    ----------
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
