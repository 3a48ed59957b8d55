"""Whether errors are white: their autocorrelation within stretches, its band, and the test of Ljung and Box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.gap.residual.whiteness import whiteness

_BAND = 1.96


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


def autocorrelation(errors: Array, stretch: IntArray, without: BoolArray, lags: int) -> Autocorrelation:
    """Correlate errors with themselves, a lag later in the same stretch.

    The band is ``1.96 / sqrt(N)``: the standard deviation of the autocorrelation of N white errors is ``1 / sqrt(N)``.

    Parameters
    ----------
    errors : array, shape (samples, 3)
    stretch : array of int, shape (samples,)
        As from `stretch_numbers`; errors are taken about the mean of each.
    without : array of bool, shape (3,)
        Axes without errors, whose rounding nobody should take for a signal.
    lags : int
        Largest lag, in samples.

    Returns
    -------
    Autocorrelation

    References
    ----------
    Box, Jenkins and Reinsel, Time Series Analysis, section 2.1.6; Ljung and Box, Biometrika 65 (1978), 297.
    """
    found = whiteness(errors, stretch, stride=1, lags=lags)
    untold = without | (len(found.autocorrelation) == 0)
    return Autocorrelation(
        value=np.where(untold, np.nan, found.autocorrelation),
        band=float(_BAND / np.sqrt(len(errors))),
        p_value=np.where(untold, np.nan, found.p_value),
    )
