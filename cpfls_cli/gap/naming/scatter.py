"""Effects with a random part: how much of what is left is their scatter, and where."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.gap.balance.balance_system import System

_LEAST_RATIO = 1.5
"""Mean square inside the scattering stretches over that outside from which scatter is believed."""


def scatter_variance(hypothesis: System) -> Array:
    """Average the variance that chosen effects can scatter, for a unit of scatter.

    Returns
    -------
    array, shape (window, 6)
        Zero where no effect scatters.
    """
    parts = []
    for flight, signals in zip(hypothesis.flights, hypothesis.signals, strict=True):
        total = np.zeros((len(flight), 6))
        for candidate in hypothesis.chosen:
            if candidate.effect.scatter is not None and not candidate.effect.missing(signals):
                total += flight.windows.average(candidate.effect.scatter(signals, candidate.shape))
        parts.append(total * flight.known)
    return np.concatenate(parts)


def scatter_size(variance: Array, residual: Array, floor: Array) -> float:
    """Estimate the scatter from what is left: one number for all channels.

    Parameters
    ----------
    variance : array, shape (window, 6)
        For a unit of scatter.
    residual : array, shape (window, 6)
    floor : array, shape (6,)

    Returns
    -------
    float
        Mean square of the relative scatter over a window; 0 where stretches that should scatter do not stand out.
    """
    expected = variance / floor**2
    if not expected.any():
        return 0.0
    square = (residual / floor) ** 2
    inside = expected > 0.2 * expected.max(axis=0, initial=0.0, keepdims=True) * np.sign(expected.max(axis=0))
    inside &= expected > 0
    if not inside.any() or square[inside].mean() < _LEAST_RATIO * max(1.0, square[~inside].mean()):
        return 0.0
    return float(max(0.0, (square[inside] - 1).sum() / expected[inside].sum()))
