"""The noise floor of each channel, from the residual at frequencies above the motion."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Columns
from cpfls_cli.gap.balance.windows import Windows
from cpfls_cli.gap.balance.windows import windows as make_windows

_FREQUENCIES = 16
_LONGER = 2
_LOWEST_PER_WINDOW = 2.8
_HIGHEST_OF_RATE = 0.4
_CORRELATIONS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95)
_CLEARLY_BETTER = 1.5
_PADDED = 8
_MEDIAN_OF_EXPONENTIAL = float(np.log(2))


def noise_floor(residual: Columns, windows: Windows) -> Array:
    """Estimate the standard deviation of the window averages that noise causes.

    The power of the residual is taken at frequencies above the motion. Spectra that noise can have are fitted to it:
    flat ones, as of rotors and angles; growing with the square, as of a gyroscope, whose derivative is taken; and both
    of noise that is correlated from sample to sample. The fit is read off at the frequencies that the windows average
    over. Longer windows tell frequencies apart better, so that the fit can start lower; the median over the windows
    keeps bursts of motion out.

    Parameters
    ----------
    residual : Columns
        What the model leaves, shape (time, 6).
    windows : Windows

    Returns
    -------
    array, shape (6,), N m and N
    """
    length = len(windows.weight) * windows.period
    longer = make_windows(windows.period, _LONGER * length, 0.5) if _fits(residual, windows) else windows
    lowest = _LOWEST_PER_WINDOW / (len(longer.weight) * longer.period)
    frequencies = np.linspace(lowest, max(_HIGHEST_OF_RATE / windows.period, 1.5 * lowest), _FREQUENCIES)
    power = np.array([_power(residual, longer, frequency) for frequency in frequencies]) / _energy(longer)
    terms = np.array([_terms(longer, frequency) for frequency in frequencies])
    window_terms = _terms(windows, 0.0) * _energy(windows)
    return np.array([_extrapolated(terms, channel, window_terms) for channel in power.T])


def _terms(windows: Windows, centre: float) -> Array:
    """Average the model spectra of noise over the passband of a window at a frequency."""
    length = len(windows.weight)
    through = np.abs(np.fft.rfft(windows.weight, _PADDED * length)) ** 2
    offset = np.fft.rfftfreq(_PADDED * length, windows.period)
    both = np.concatenate([centre - offset[:0:-1], centre + offset])
    share = np.concatenate([through[:0:-1], through])
    phase = 2 * np.pi * both * windows.period
    rising = both**2
    colours = [1 / (1 + rho**2 - 2 * rho * np.cos(phase)) for rho in _CORRELATIONS]
    spectra = np.array([spectrum for colour in colours for spectrum in (colour, rising * colour)])
    return np.asarray(spectra @ share / share.sum())


def _fits(residual: Columns, windows: Windows) -> bool:
    return len(residual.direct) >= 4 * _LONGER * len(windows.weight)


def _energy(windows: Windows) -> float:
    return float((windows.weight**2).sum())


def _extrapolated(terms: Array, power: Array, window_terms: Array) -> float:
    """Fit a flat and a rising spectrum, white unless coloured ones fit clearly better; evaluate them for a window."""
    if not power.min() > 0:
        return 0.0
    # Dividing by the power makes relative errors of equal weight.
    relative = terms / power[:, None]
    pairs = [(flat, rising) for flat in range(0, terms.shape[1], 2) for rising in range(1, terms.shape[1], 2)]
    fits = [nnls(relative[:, pair], np.ones(len(power))) for pair in pairs]
    best = int(np.argmin([misfit for _, misfit in fits]))
    chosen = 0 if fits[0][1] ** 2 <= _CLEARLY_BETTER * fits[best][1] ** 2 else best
    return float(np.sqrt(fits[chosen][0] @ window_terms[list(pairs[chosen])]))


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
