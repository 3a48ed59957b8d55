"""Residual analysis of the torque of a model: whiteness, bias, correlation with its inputs; samples in time order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import chdtrc, ndtri, stdtr

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import FEWEST_BLOCKS, MOST_COMPARED, mean_error
from cpfls_cli.identification.data import TorqueData, TorqueSource, gathered, sample_times
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.result import EULER, about
from cpfls_cli.rotations import wrapped

# Flights of several sample rates may follow each other, and samples may be missing: as many steps around each tell
# what is usual there.
_STEPS_AROUND = 25

# By default enough that Student's t is that of a normal distribution; more than 200 take time and add nothing.
_DEFAULT_BLOCKS, _MOST_BLOCKS, _FEWEST_BLOCKS = 40, 200, 2

# Shorter blocks are no longer independent of their neighbours where noise is coloured.
_FEWEST_IN_BLOCK = 20


def sample_period(time: Array) -> float:
    """Compute the usual (median) time from one sample to the next, s; NaN for a single sample."""
    return float(np.median(np.diff(time))) if len(time) > 1 else float("nan")


def stretch_numbers(time: Array) -> IntArray:
    """Label every sample by its stretch from 0, in which samples follow each other without a pause.

    Times ascend and may jitter by less than half a step; a pause is a step of more than one and a half of those usual
    around it.
    """
    number = np.zeros(len(time), dtype=np.int64)
    number[1:] = np.cumsum(_steps(time) > 1)
    return number


def sample_numbers(time: Array, longest: int) -> IntArray:
    """Count samples from 0 by their time, so that missing ones are counted too.

    Times ascend and may jitter by less than half a step; no pause counts as more than `longest` steps.
    """
    number = np.zeros(len(time), dtype=np.int64)
    number[1:] = np.cumsum(np.clip(_steps(time), 1, longest).astype(np.int64))
    return number


def lagged_pairs(number: IntArray, lag: int) -> tuple[IntArray, IntArray]:
    """Find the indices of pairs of samples, numbered as by `sample_numbers`, that are a lag of 0 or more apart."""
    later = np.searchsorted(number, number + lag)
    earlier = np.flatnonzero(later < len(number))
    earlier = earlier[number[later[earlier]] == number[earlier] + lag]
    return earlier, later[earlier]


def _steps(time: Array) -> Array:
    """Round the steps to whole numbers of sample periods from one sample to the next, shape (samples - 1,)."""
    step = np.diff(time)
    return np.rint(step / median_filter(step, size=_STEPS_AROUND)) if len(step) else step


@dataclass(frozen=True)
class TimeBlocks:
    """Blocks of equal numbers of training samples: where each but the first begins, and how long one lasts, s."""

    starts: Array
    duration: float

    def number(self, time: Array) -> IntArray:
        """Find the block of each sample, from 0, by its time in s."""
        return np.searchsorted(self.starts, time, side="right").astype(np.int64)

    def labels(self, source: TorqueSource) -> IntArray:
        """Label each sample of a source by its block, from 0; blocks without samples are not counted."""
        number = self.number(sample_times(source))
        label = np.cumsum(np.bincount(number) > 0) - 1
        return np.asarray(label[number])


def time_blocks(training: TorqueSource, block_duration: float | None, most: int = _MOST_BLOCKS) -> TimeBlocks:
    """Cut a training part into blocks of a duration in s; None: a fortieth of it.

    There are 2 to 200 blocks, or `most` where there is memory for fewer; above two, each has 20 samples at least, so a
    short flight has fewer blocks than asked for, and a long one longer blocks.
    """
    time = sample_times(training)
    samples = len(time)
    step = float(np.median(np.diff(time))) if samples > 1 else 0.0
    asked = _DEFAULT_BLOCKS if block_duration is None else round(samples * step / block_duration)
    count = min(asked, _MOST_BLOCKS, most, samples // _FEWEST_IN_BLOCK)
    count = min(max(count, _FEWEST_BLOCKS), samples)
    return TimeBlocks(time[np.arange(1, count) * samples // count], samples * step / count)


# More do not change a picture; 0.1 GB of signals.
_MOST_SAMPLES = 200_000
# Sixteen digits, less those that a badly conditioned solution and a chain of rotations cost.
_ROUNDING = 1e-9
_BINS = 41
_PROBABILITIES = np.arange(1, 100) / 100

# Normal errors lie within it in 95 of 100 cases.
_BAND = 1.96
# Lags of fewer samples than a quarter, or whose pairs are fewer, say little and spoil the distribution of the test.
_FEWEST_PER_LAG = 4

# Of a block.
_FEWEST_SAMPLES = 50

# What varies by less than this share of the largest value of its kind is the rounding of a constant.
_CONSTANT = 1e-9


@dataclass(frozen=True, eq=False)
class ResidualAnalysis:
    """Torque errors, measured minus predicted, on one part of the data."""

    part: str = about("part whose residuals are examined")
    samples: int = about("residuals examined")
    available: int = about("residuals of the whole part")
    mean: Array = about("constant torque that the model lacks", "axis", unit="N m", frame=EULER, gaps=True)
    mean_p: Array = about("p-value of a mean of 0: small where it is not", "axis", frame=EULER, gaps=True)
    lag: Array = about("lags of the autocorrelation, from one sample on", "lag", unit="s", brief=False)
    autocorrelation: Array = about("of the torque error", "lag", "axis", frame=EULER, gaps=True, brief=False)
    band: float = about("1.96 / sqrt(samples): holds 95 % of the lags of white noise")
    ljung_box: Array = about("p-value of Ljung and Box: small where not white", "axis", frame=EULER, gaps=True)
    input: tuple[str, ...] = about("signals that errors are correlated with", "input", brief=False)
    input_lag: Array = about("positive: the error follows the input", "input_lag", unit="s", brief=False)
    correlation: Array = about("of error and input", "input", "input_lag", "axis", frame=EULER, gaps=True, brief=False)
    histogram_edge: Array = about("edges of the bins", "edge", "axis", unit="N m", frame=EULER, brief=False)
    histogram_count: IntArray = about("errors in each bin", "bin", "axis", frame=EULER, brief=False)
    normal_quantile: Array = about("quantiles of the standard normal distribution", "quantile", brief=False)
    quantile: Array = about(
        "the same quantiles of the errors", "quantile", "axis", unit="N m", frame=EULER, brief=False
    )
    exact: BoolArray = about("1 where errors are rounding, which is never white", "axis", frame=EULER)


def examine_residuals(
    part: str, source: TorqueSource, torque: Callable[[Motion], Array], lags: int
) -> ResidualAnalysis:
    """Examine the torque errors of a model in the order of time, of the first 200 000 samples, up to the largest lag.

    Ljung, System Identification: Theory for the User, section 16.6 (residual analysis).
    """
    data = gathered(source, np.arange(min(len(source), _MOST_SAMPLES)))
    predicted = torque(data.motion)
    errors, period, number = data.torque - predicted, sample_period(data.time), sample_numbers(data.time, lags + 1)
    exact = np.max(np.abs(errors), axis=0) <= _ROUNDING * np.max(np.abs(data.torque))
    correlated, p_value = autocorrelation(errors, number, exact, lags)
    inputs = model_inputs(data, predicted)
    edges, counts = _histogram(errors)
    return ResidualAnalysis(
        part=part,
        samples=len(data),
        available=len(source),
        mean=errors.mean(axis=0),
        mean_p=mean_p_value(errors, exact),
        lag=period * np.arange(1, len(correlated) + 1, dtype=float),
        autocorrelation=correlated,
        # White errors have a standard deviation of 1 / sqrt(n) at each lag, a smaller one where pairs are missing.
        band=float(_BAND / np.sqrt(len(data))),
        ljung_box=p_value,
        input=inputs.name,
        input_lag=period * np.arange(-lags, lags + 1, dtype=float),
        correlation=cross_correlation(errors, inputs, number, exact, lags),
        histogram_edge=edges,
        histogram_count=counts,
        normal_quantile=np.asarray(ndtri(_PROBABILITIES)),
        quantile=np.quantile(errors, _PROBABILITIES, axis=0),
        exact=exact,
    )


def _histogram(errors: Array) -> tuple[Array, IntArray]:
    largest = np.max(np.abs(errors), axis=0)
    edges = np.linspace(-1.0, 1.0, _BINS + 1)[:, None] * np.where(largest > 0, largest, 1.0)
    counts = [np.histogram(axis, bins=edge)[0] for axis, edge in zip(errors.T, edges.T, strict=True)]
    return edges, np.stack(counts, axis=1)


def autocorrelation(errors: Array, number: IntArray, without: BoolArray, lags: int) -> tuple[Array, Array]:
    """Compute the autocorrelation of errors about their mean, and the p-value of the test of Ljung and Box.

    ``r_k = sum_k e(t) e(t + k) / sum e^2`` over the n_k pairs that are k samples apart, whatever is missing between
    them. ``Q = n (n + 2) sum_k r_k^2 / n_k`` is held against chi square with as many degrees of freedom as lags. Shapes
    (lag, 3), from one sample on, and (3,): small where the errors are not white; NaN for axes `without` errors, whose
    rounding nobody should take for a signal. Fewer lags than asked for where all stretches are short. Box, Jenkins and
    Reinsel, Time Series Analysis, section 2.1.6; Ljung and Box, Biometrika 65 (1978), 297; with missing samples:
    Stoffer and Toloi, Statistics and Probability Letters 13 (1992), 391.
    """
    samples, centred = len(errors), errors - errors.mean(axis=0)
    products, pairs = _products(centred, number, min(lags, samples // _FEWEST_PER_LAG))
    square = np.sum(centred**2, axis=0)
    value = products / np.where(square > 0, square, 1.0)
    statistic = samples * (samples + 2) * np.sum(value**2 / pairs[:, None], axis=0)
    unknown = without | (len(pairs) == 0)
    p_value = np.where(unknown, np.nan, chdtrc(max(len(pairs), 1), statistic))
    return np.where(unknown, np.nan, value), p_value


def _products(centred: Array, number: IntArray, lags: int) -> tuple[Array, IntArray]:
    """Sum products and count pairs at each lag from 1 on, shapes (lag, 3) and (lag,)."""
    products, pairs = np.zeros((lags, centred.shape[1])), np.zeros(lags, dtype=np.int64)
    for index in range(lags):
        earlier, later = lagged_pairs(number, index + 1)
        products[index], pairs[index] = np.sum(centred[earlier] * centred[later], axis=0), len(earlier)
    few = np.flatnonzero(_FEWEST_PER_LAG * pairs < len(centred))
    enough = few[0] if len(few) else lags
    return products[:enough], pairs[:enough]


def mean_p_value(errors: Array, without: BoolArray) -> Array:
    """Test whether errors are 0 in the mean, by Student's test of their means over blocks of time; small where not.

    ``t = m / (s / sqrt B)`` with m the mean and s the standard deviation of the B block means. Neighbouring errors are
    alike where filters were at work, so that they count as fewer than they are; means over long blocks are not. NaN for
    an axis without errors, and for all of fewer than four samples.
    """
    blocks = min(max(len(errors) // _FEWEST_SAMPLES, FEWEST_BLOCKS), MOST_COMPARED)
    if len(errors) < blocks:
        return np.full(errors.shape[1], np.nan)
    means = np.array([block.mean(axis=0) for block in np.array_split(errors, blocks)])
    middle, spread = means.mean(axis=0), mean_error(means)
    # A constant without any noise is not chance.
    ratio = np.where(middle == 0, 0.0, np.abs(middle) / np.maximum(spread, np.finfo(float).tiny))
    return np.where(without, np.nan, 2 * stdtr(blocks - 1, -ratio))


@dataclass(frozen=True)
class ModelInputs:
    """Inputs of a model, shape (samples, input), which its errors may be correlated with where they vary."""

    name: tuple[str, ...]
    value: Array
    varies: BoolArray


def model_inputs(data: TorqueData, predicted: Array) -> ModelInputs:
    """List the inputs of a model (attitude within one turn, Euler rates, accelerations) and the torque it predicts.

    Not the measured torque, which holds the error and so is correlated with it even where the model is perfect.
    """
    motion, axes = data.motion, ("roll", "pitch", "yaw")
    kinds = {
        "{}": wrapped(motion.attitude[:, :2]),
        "{} rate": motion.rate,
        "{} acceleration": motion.acceleration,
        "predicted {} torque": predicted,
    }
    return ModelInputs(
        name=tuple(kind.format(axis) for kind, values in kinds.items() for axis in axes[: values.shape[1]]),
        value=np.concatenate(list(kinds.values()), axis=1),
        varies=np.concatenate(
            [np.std(values, axis=0) > _CONSTANT * np.max(np.abs(values), initial=0.0) for values in kinds.values()]
        ),
    )


def cross_correlation(errors: Array, inputs: ModelInputs, number: IntArray, without: BoolArray, lags: int) -> Array:
    """Compute the cross-correlation of errors with inputs at lags to both sides, both about their means.

    ``r(k) = sum_k u(t) e(t + k) / sqrt(sum u^2 sum e^2)`` over the pairs that are k samples apart; shape (input, 2 lags
    + 1, 3), from the most negative lag on: at a positive lag the error follows the input. NaN for constant inputs and
    axes without errors.
    """
    e, u = errors - errors.mean(axis=0), inputs.value - inputs.value.mean(axis=0)
    products = np.zeros((2 * lags + 1, u.shape[1], e.shape[1]))
    for lag in range(lags + 1):
        earlier, later = lagged_pairs(number, lag)
        products[lags + lag] = u[earlier].T @ e[later]
        products[lags - lag] = u[later].T @ e[earlier]
    size = np.sqrt(np.outer(np.sum(u**2, axis=0), np.sum(e**2, axis=0)))
    known = np.outer(inputs.varies, ~without) & (size > 0)
    return np.moveaxis(np.where(known, products / np.where(known, size, 1.0), np.nan), 0, 1)
