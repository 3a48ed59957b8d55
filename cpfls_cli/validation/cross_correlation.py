"""Whether errors follow anything that the model knows of: their correlation with its inputs at all lags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.fuzzy.inputs import wrap
from cpfls_cli.gap.balance.mirrored import about_flight_mean
from cpfls_cli.identification.data import TorqueData

# What varies by less than this share of the largest value of its kind is the rounding of a constant.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Inputs:
    """Signals that errors may follow.

    Attributes
    ----------
    name : tuple of str
    value : array, shape (samples, input)
    varies : array of bool, shape (input,)
        False for constants, that nothing can be correlated with.
    """

    name: tuple[str, ...]
    value: Array
    varies: BoolArray


def inputs_of(data: TorqueData) -> Inputs:
    """List what a model is told: attitude, Euler rates and accelerations; and the torque itself.

    Parameters
    ----------
    data : TorqueData

    Returns
    -------
    Inputs
        Angles within one turn.
    """
    motion, axes = data.motion, ("roll", "pitch", "yaw")
    kinds = {
        "": wrap(motion.attitude[:, :2]),
        " rate": motion.rate,
        " acceleration": motion.acceleration,
        " torque": data.torque,
    }
    return Inputs(
        name=tuple(f"{axis}{kind}" for kind, values in kinds.items() for axis in axes[: values.shape[1]]),
        value=np.concatenate(list(kinds.values()), axis=1),
        varies=np.concatenate([_varies(values) for values in kinds.values()]),
    )


def cross_correlation(errors: Array, inputs: Inputs, stretch: IntArray, without: BoolArray, lags: int) -> Array:
    """Correlate errors with inputs within stretches, ``r(k) = sum u(t) e(t + k) / sqrt(sum u^2 sum e^2)``.

    Parameters
    ----------
    errors : array, shape (samples, 3)
    inputs : Inputs
    stretch : array of int, shape (samples,)
        As from `stretch_numbers`; both are taken about the mean of each.
    without : array of bool, shape (3,)
        Axes without errors.
    lags : int
        Largest lag to both sides, in samples.

    Returns
    -------
    array, shape (input, 2 lags + 1, 3)
        From the most negative lag on; at a positive lag the error follows the input. NaN for constant inputs and axes
        without errors.
    """
    e, u = about_flight_mean(errors, stretch), about_flight_mean(inputs.value, stretch)
    products = np.zeros((2 * lags + 1, u.shape[1], e.shape[1]))
    for number in np.unique(stretch):
        own = stretch == number
        for place, lag in enumerate(range(-lags, lags + 1)):
            products[place] += _product(u[own], e[own], lag)
    size = np.sqrt(np.outer(np.sum(u**2, axis=0), np.sum(e**2, axis=0)))
    told = np.outer(inputs.varies, ~without) & (size > 0)
    return np.moveaxis(np.where(told, products / np.where(told, size, 1.0), np.nan), 0, 1)


def _product(u: Array, e: Array, lag: int) -> Array:
    pairs = max(len(u) - abs(lag), 0)
    earlier, later = max(-lag, 0), max(lag, 0)
    return np.asarray(u[earlier : earlier + pairs].T @ e[later : later + pairs])


def _varies(values: Array) -> BoolArray:
    return np.asarray(np.std(values, axis=0) > _ROUNDING * np.max(np.abs(values), initial=0.0))
