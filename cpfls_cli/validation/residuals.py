"""What a model leaves of the torque: white or not, related to its inputs or not, normal or not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.validation.autocorrelation import autocorrelation
from cpfls_cli.validation.bias import mean_p_value
from cpfls_cli.validation.cross_correlation import cross_correlation, inputs_of
from cpfls_cli.validation.stretches import leading, sample_numbers, sample_period

# More do not change a picture; 0.1 GB of signals.
_MOST_SAMPLES = 200_000
# Sixteen digits, less those that a badly conditioned solution and a chain of rotations cost.
_ROUNDING = 1e-9
_BINS = 41
_PROBABILITIES = np.arange(1, 100) / 100


@dataclass(frozen=True)
class ResidualAnalysis:
    """Torque errors, measured minus predicted, on the Euler axes.

    Attributes
    ----------
    part : str
        Part of the data.
    samples : int
        Errors examined: the leading ones of a long part.
    available : int
        Errors of the whole part.
    mean : array, shape (3,), N m
        A constant torque that the model lacks; autocorrelation does not show it.
    mean_p : array, shape (3,)
        p-value: small where the mean is not 0; NaN for an exact axis.
    lag : array, shape (lag,), s
        From one sample on.
    autocorrelation : array, shape (lag, 3)
        NaN for an exact axis.
    band : float
        ``1.96 / sqrt(samples)``.
    ljung_box : array, shape (3,)
        p-value: small where errors are not white; NaN for an exact axis.
    input : tuple of str
        Signals that errors are correlated with.
    input_lag : array, shape (input lag,), s
        Positive: the error follows the input.
    correlation : array, shape (input, input lag, 3)
        NaN for a constant input and for an exact axis.
    histogram_edge : array, shape (bin + 1, 3), N m
        Symmetric about 0, to the largest error.
    histogram_count : array of int, shape (bin, 3)
    normal_quantile : array, shape (99,)
        Of the standard normal distribution.
    quantile : array, shape (99, 3), N m
        Of the errors.
    exact : array of bool, shape (3,)
        Axes whose largest error is below a billionth of the largest torque: rounding, which is never white and says
        nothing of the model.
    """

    part: str
    samples: int
    available: int
    mean: Array
    mean_p: Array
    lag: Array
    autocorrelation: Array
    band: float
    ljung_box: Array
    input: tuple[str, ...]
    input_lag: Array
    correlation: Array
    histogram_edge: Array
    histogram_count: IntArray
    normal_quantile: Array
    quantile: Array
    exact: BoolArray


def examine_residuals(
    part: str, source: TorqueSource, torque: Callable[[Motion], Array], lags: int
) -> ResidualAnalysis:
    """Examine the torque errors of a model in the order of time.

    Parameters
    ----------
    part : str
        Name of the part of the data.
    source : TorqueSource
        Its first 200 000 samples are examined.
    torque : callable
        Predicts the generalised torque of a motion.
    lags : int
        Largest lag, in samples.

    References
    ----------
    Ljung, System Identification: Theory for the User, section 16.6 (residual analysis).
    """
    data = leading(source, _MOST_SAMPLES)
    predicted = torque(data.motion)
    errors, period, number = data.torque - predicted, sample_period(data.time), sample_numbers(data.time, lags + 1)
    exact = np.max(np.abs(errors), axis=0) <= _ROUNDING * np.max(np.abs(data.torque))
    own, inputs = autocorrelation(errors, number, exact, lags), inputs_of(data, predicted)
    edges, counts = _histogram(errors)
    return ResidualAnalysis(
        part=part,
        samples=len(data),
        available=len(source),
        mean=errors.mean(axis=0),
        mean_p=mean_p_value(errors, exact),
        lag=period * np.arange(1, len(own.value) + 1, dtype=float),
        autocorrelation=own.value,
        band=own.band,
        ljung_box=own.p_value,
        input=inputs.name,
        input_lag=period * np.arange(-lags, lags + 1, dtype=float),
        correlation=cross_correlation(errors, inputs, number, exact, lags),
        histogram_edge=edges,
        histogram_count=counts,
        normal_quantile=np.asarray(norm.ppf(_PROBABILITIES)),
        quantile=np.quantile(errors, _PROBABILITIES, axis=0),
        exact=exact,
    )


def _histogram(errors: Array) -> tuple[Array, IntArray]:
    largest = np.max(np.abs(errors), axis=0)
    edges = np.linspace(-1.0, 1.0, _BINS + 1)[:, None] * np.where(largest > 0, largest, 1.0)
    counts = [np.histogram(own, bins=edge)[0] for own, edge in zip(errors.T, edges.T, strict=True)]
    return edges, np.stack(counts, axis=1)
