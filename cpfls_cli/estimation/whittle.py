"""Random processes by their power: Gauss-Markov processes as windows see them, and Whittle's likelihood."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array

_STEPS = 500
"""Of the search."""

Spectrum = Callable[[Array], tuple[Array, Callable[[Array], Array]]]
"""From numbers to the expected power, shape (piece, frequency) or (frequency,), and to a function that turns slopes by
that, shape (piece, frequency), into slopes by the numbers."""


class GaussMarkov(NamedTuple):
    """Power that a Gauss-Markov process of unit size has in windows, by its memory.

    Attributes
    ----------
    alike : array, shape (frequency, lag)
        Power by frequency that unit correlation at a lag has.
    lags : array, shape (lag,), s
    """

    alike: Array
    lags: Array

    @classmethod
    def seen_by(cls, weight: Array, period: float, turns: Array) -> GaussMarkov:
        """Take windows of a weight, shape (sample,), at some frequencies, rad/s."""
        lags = np.asarray(period * np.arange(len(weight)), dtype=float)
        alike = np.correlate(weight, weight, "full")[len(weight) - 1 :]
        return cls(np.cos(np.outer(turns, lags)) * alike * np.where(lags == 0, 1.0, 2.0), lags)

    def power(self, memory: float) -> tuple[Array, Array]:
        """Give the power by frequency, and its derivative by the logarithm of the memory, shapes (frequency,)."""
        ages = self.lags / memory
        falls = np.exp(-ages)
        return self.alike @ falls, self.alike @ (falls * ages)


def most_likely(
    spectrum: Spectrum, power: Array, starts: Sequence[Array], bounds: Sequence[tuple[float, float]]
) -> Array:
    """Find the numbers of a spectrum that make the power of pieces most likely.

    Parameters
    ----------
    power : array, shape (piece, frequency)
    starts : sequence of array, shape (number,)
        The best of all ends counts.

    References
    ----------
    Whittle 1953, Estimation and information in stationary time series.
    """
    from scipy.optimize import minimize

    def unlikely(numbers: Array) -> tuple[float, Array]:
        expected, slopes_by = spectrum(numbers)
        ratio = power / expected
        worse = float((ratio + np.log(expected)).sum()) / len(power)
        return worse, slopes_by((1.0 - ratio) / expected) / len(power)

    found = (
        minimize(unlikely, own, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": _STEPS})
        for own in starts
    )
    return np.asarray(min(found, key=lambda each: float(each.fun)).x)
