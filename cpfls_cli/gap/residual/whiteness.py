"""Whether what is left is noise: correlation of windows that share no samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.gap.balance.mirrored import about_flight_mean

_FEWEST_PER_LAG = 4


@dataclass(frozen=True)
class Whiteness:
    """Autocorrelation of a residual, and the test whether it is that of noise.

    Attributes
    ----------
    autocorrelation : array, shape (lag, channel)
        At lags of 1, 2, ... windows without common samples.
    statistic : array, shape (channel,)
        Of Ljung and Box; about the number of lags for noise.
    p_value : array, shape (channel,)
        Small where the residual is not noise; 1 for channels that are 0.
    windows : int
        Used, over all flights.
    """

    autocorrelation: Array
    statistic: Array
    p_value: Array
    windows: int


def whiteness(residual: Array, flight_index: IntArray, stride: int = 2, lags: int = 10) -> Whiteness:
    """Test whether a residual is noise, flight by flight about its mean.

    ``Q = n (n + 2) sum_k r_k^2 / n_k`` with n_k pairs of windows at lag k, against chi square with as many degrees of
    freedom as lags.

    Parameters
    ----------
    residual : array, shape (window, channel)
    flight_index : array of int, shape (window,)
    stride : int
        Windows from one to the next without common samples; 2 at an overlap of a half.
    lags : int
        Largest lag; fewer where flights are short.

    References
    ----------
    Ljung and Box 1978, equation 1.4.
    """
    flights = [residual[flight_index == flight][::stride] for flight in np.unique(flight_index)]
    longest = max((len(rows) for rows in flights), default=0)
    lags = min(lags, longest // _FEWEST_PER_LAG)
    rows = [about_flight_mean(own, np.zeros(len(own), dtype=int)) for own in flights]
    used = sum(len(own) for own in rows)
    square = np.sum([(own**2).sum(axis=0) for own in rows], axis=0)
    products = np.array([_product(rows, lag) for lag in range(1, lags + 1)]).reshape(lags, residual.shape[1])
    pairs = np.array([sum(max(0, len(own) - lag) for own in rows) for lag in range(1, lags + 1)])
    correlation = np.divide(products, square, out=np.zeros_like(products), where=square > 0)
    statistic = used * (used + 2) * (correlation**2 / pairs[:, None]).sum(axis=0)
    return Whiteness(correlation, statistic, chi2.sf(statistic, lags) if lags else np.ones_like(statistic), used)


def _product(rows: list[Array], lag: int) -> Array:
    return np.asarray(np.sum([(own[lag:] * own[: max(0, len(own) - lag)]).sum(axis=0) for own in rows], axis=0))
