"""The noise floor of each channel, from the flight itself: what is left at frequencies where nothing moves."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Columns
from cpfls_cli.gap.windows import Windows

_FREQUENCIES = 8
_LOWEST_PER_WINDOW = 2.8
_HIGHEST_OF_RATE = 0.4
_MEDIAN_OF_EXPONENTIAL = float(np.log(2))


def noise_floor(residual: Columns, windows: Windows) -> Array:
    """Estimate the standard deviation that noise gives a window.

    The power of the residual is taken through the same windows at frequencies above the motion, a constant and a
    square of frequency are fitted to it (noise of the rotors and of angles is flat in torque, white noise of the
    gyroscope grows with the square, its coloured noise is flat again), and the fit is read off at the frequencies that
    the windows average over. The median over the windows keeps bursts of motion out.

    Parameters
    ----------
    residual : Columns
        What the model leaves, shape (time, 6).
    windows : Windows

    Returns
    -------
    array, shape (6,), N m and N
    """
    rate = 1.0 / windows.period
    lowest = _LOWEST_PER_WINDOW / (len(windows.weight) * windows.period)
    frequencies = np.linspace(lowest, max(_HIGHEST_OF_RATE * rate, 1.5 * lowest), _FREQUENCIES)
    power = np.array([_power(residual, windows, frequency) for frequency in frequencies])
    spread = _mean_square_frequency(windows)
    terms = np.stack([np.ones_like(frequencies), frequencies**2 + spread], axis=1)
    return np.array([_extrapolated(terms, channel, spread) for channel in power.T])


def _extrapolated(terms: Array, power: Array, spread: float) -> float:
    if not power.min() > 0:
        return 0.0
    # Dividing by the power makes relative errors of equal weight.
    flat, rising = nnls(terms / power[:, None], np.ones(len(power)))[0]
    return float(np.sqrt(flat + rising * spread))


def _power(residual: Columns, windows: Windows, frequency: float) -> Array:
    through = modulated(windows, frequency)
    rows = through.average(residual.direct)
    if residual.momentum is not None:
        rows = rows + through.derivative(residual.momentum)
    return np.asarray(np.median(np.abs(rows) ** 2, axis=0) / _MEDIAN_OF_EXPONENTIAL)


def modulated(windows: Windows, frequency: float) -> Windows:
    """Shift windows to a frequency, ``phi(t) exp(-2 pi i f t)``.

    Parameters
    ----------
    windows : Windows
    frequency : float
        Hz.

    Returns
    -------
    Windows
        Complex.
    """
    turn = 2j * np.pi * frequency
    phase = np.exp(-turn * windows.period * np.arange(len(windows.weight)))
    return Windows(windows.weight * phase, (windows.slope - turn * windows.weight) * phase, windows.hop, windows.period)


def _mean_square_frequency(windows: Windows) -> float:
    """Average f^2 over the frequencies that a window lets through, Hz^2."""
    return float((windows.slope**2).sum() / (windows.weight**2).sum() / (2 * np.pi) ** 2)
