"""Judge torque predictions, axis by axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.rotations import body_torque


@dataclass(frozen=True)
class Score:
    """How well a prediction meets measured torque.

    Attributes
    ----------
    mse : array, shape (3,), (N m)^2
        Mean squared error by Euler axis.
    max_error : array, shape (3,), N m
        Largest absolute error.
    relative_error : array, shape (3,)
        Largest error over largest torque; NaN for an axis without torque.
    r2 : array, shape (3,)
        Share of the torque's variance explained; NaN for an axis whose torque does not vary.
    r2_body : array, shape (3,)
        The same for body torque.
    """

    mse: Array
    max_error: Array
    relative_error: Array
    r2: Array
    r2_body: Array

    @property
    def worst_relative_error(self) -> float:
        """Largest relative error of the axes that have torque; 0 if none has."""
        return float(np.max(self.relative_error[np.isfinite(self.relative_error)], initial=0.0))


def score(data: TorqueData, predicted: Array) -> Score:
    """Compare a prediction with the torque of a flight.

    Parameters
    ----------
    data : TorqueData
    predicted : array, shape (samples, 3), N m
        Generalised torque.

    Returns
    -------
    Score
    """
    error = data.torque - predicted
    max_error, largest = np.max(np.abs(error), axis=0), np.max(np.abs(data.torque), axis=0)
    attitude = data.motion.attitude
    return Score(
        mse=np.mean(error**2, axis=0),
        max_error=max_error,
        relative_error=_ratio(max_error, largest),
        r2=r_squared(data.torque, error),
        r2_body=r_squared(body_torque(attitude, data.torque), body_torque(attitude, error)),
    )


def r_squared(measured: Array, error: Array) -> Array:
    """Share of the variance explained, ``1 - sum e^2 / sum (y - mean y)^2``.

    Parameters
    ----------
    measured : array, shape (samples, channels)
    error : array, shape (samples, channels)

    Returns
    -------
    array, shape (channels,)
        NaN where the measured channel does not vary.
    """
    total = np.sum((measured - np.mean(measured, axis=0)) ** 2, axis=0)
    return 1.0 - _ratio(np.sum(error**2, axis=0), total)


def _ratio(numerator: Array, denominator: Array) -> Array:
    safe = np.where(denominator > 0, denominator, 1.0)
    return np.where(denominator > 0, numerator / safe, np.nan)
