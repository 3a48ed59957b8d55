"""Whether errors follow anything that the model knows of: their correlation with its inputs at all lags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.fuzzy.inputs import wrap
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.validation.stretches import lagged_pairs

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


def inputs_of(data: TorqueData, predicted: Array) -> Inputs:
    """List what a model is told: attitude, Euler rates and accelerations; and the torque that it makes of them.

    Not the measured torque, which holds the error and so is correlated with it even where the model is perfect.

    Parameters
    ----------
    data : TorqueData
    predicted : array, shape (samples, 3), N m
        Torque of the model.

    Returns
    -------
    Inputs
        Angles within one turn.
    """
    motion, axes = data.motion, ("roll", "pitch", "yaw")
    kinds = {
        "{}": wrap(motion.attitude[:, :2]),
        "{} rate": motion.rate,
        "{} acceleration": motion.acceleration,
        "predicted {} torque": predicted,
    }
    return Inputs(
        name=tuple(kind.format(axis) for kind, values in kinds.items() for axis in axes[: values.shape[1]]),
        value=np.concatenate(list(kinds.values()), axis=1),
        varies=np.concatenate([_varies(values) for values in kinds.values()]),
    )


def cross_correlation(errors: Array, inputs: Inputs, number: IntArray, without: BoolArray, lags: int) -> Array:
    """Correlate errors with inputs a lag earlier or later, both about their means.

    ``r(k) = sum_k u(t) e(t + k) / sqrt(sum u^2 sum e^2)`` over the pairs that are k samples apart.

    Parameters
    ----------
    errors : array, shape (samples, 3)
    inputs : Inputs
    number : array of int, shape (samples,)
        As from `sample_numbers`.
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
    e, u = errors - errors.mean(axis=0), inputs.value - inputs.value.mean(axis=0)
    products = np.zeros((2 * lags + 1, u.shape[1], e.shape[1]))
    for lag in range(lags + 1):
        earlier, later = lagged_pairs(number, lag)
        products[lags + lag] = u[earlier].T @ e[later]
        products[lags - lag] = u[later].T @ e[earlier]
    size = np.sqrt(np.outer(np.sum(u**2, axis=0), np.sum(e**2, axis=0)))
    told = np.outer(inputs.varies, ~without) & (size > 0)
    return np.moveaxis(np.where(told, products / np.where(told, size, 1.0), np.nan), 0, 1)


def _varies(values: Array) -> BoolArray:
    return np.asarray(np.std(values, axis=0) > _ROUNDING * np.max(np.abs(values), initial=0.0))
