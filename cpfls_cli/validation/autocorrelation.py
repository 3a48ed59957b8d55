"""Whether errors are white: their autocorrelation, its band, and the test of Ljung and Box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.validation.stretches import lagged_pairs

_BAND = 1.96
# Lags of fewer samples than a quarter, or whose pairs are fewer, say little and spoil the distribution of the test.
_FEWEST_PER_LAG = 4


@dataclass(frozen=True)
class Autocorrelation:
    """Autocorrelation of errors by axis.

    Attributes
    ----------
    value : array, shape (lag, 3)
        From one sample on; NaN for an axis without errors. Fewer lags than asked for where all stretches are short.
    band : float
        Holds 95 % of the lags of white noise.
    p_value : array, shape (3,)
        Small where the errors are not white; NaN for an axis without errors.
    """

    value: Array
    band: float
    p_value: Array


def autocorrelation(errors: Array, number: IntArray, without: BoolArray, lags: int) -> Autocorrelation:
    """Correlate errors with themselves a lag later, about the mean of them all.

    ``r_k = sum_k e(t) e(t + k) / sum e^2`` over the n_k pairs that are k samples apart, whatever is missing between
    them. The band is ``1.96 / sqrt(n)``: the standard deviation of the autocorrelation of n white errors is
    ``1 / sqrt(n)``, and less where pairs are missing. ``Q = n (n + 2) sum_k r_k^2 / n_k`` is held against chi square
    with as many degrees of freedom as lags.

    Parameters
    ----------
    errors : array, shape (samples, 3)
    number : array of int, shape (samples,)
        As from `sample_numbers`.
    without : array of bool, shape (3,)
        Axes without errors, whose rounding nobody should take for a signal.
    lags : int
        Largest lag, in samples.

    References
    ----------
    Box, Jenkins and Reinsel, Time Series Analysis, section 2.1.6; Ljung and Box, Biometrika 65 (1978), 297; with
    missing samples: Stoffer and Toloi, Statistics and Probability Letters 13 (1992), 391.
    """
    samples, own = len(errors), errors - errors.mean(axis=0)
    products, pairs = _products(own, number, min(lags, samples // _FEWEST_PER_LAG))
    square = np.sum(own**2, axis=0)
    value = products / np.where(square > 0, square, 1.0)
    statistic = samples * (samples + 2) * np.sum(value**2 / pairs[:, None], axis=0)
    untold = without | (len(pairs) == 0)
    return Autocorrelation(
        value=np.where(untold, np.nan, value),
        band=float(_BAND / np.sqrt(samples)),
        p_value=np.where(untold, np.nan, chi2.sf(statistic, max(len(pairs), 1))),
    )


def _products(own: Array, number: IntArray, lags: int) -> tuple[Array, IntArray]:
    """Sum products and count pairs at each lag from 1 on, shapes (lag, 3) and (lag,)."""
    products, pairs = np.zeros((lags, own.shape[1])), np.zeros(lags, dtype=np.int64)
    for place in range(lags):
        earlier, later = lagged_pairs(number, place + 1)
        products[place], pairs[place] = np.sum(own[earlier] * own[later], axis=0), len(earlier)
    few = np.flatnonzero(_FEWEST_PER_LAG * pairs < len(own))
    told = few[0] if len(few) else lags
    return products[:told], pairs[:told]
