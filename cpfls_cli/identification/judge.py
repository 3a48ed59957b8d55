"""Scores of torque predictions by axis, and the baselines that a model must beat."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics import rigid_columns, vertical
from cpfls_cli.identification.data import TorqueData, TorqueSource
from cpfls_cli.inertia import symmetric_columns
from cpfls_cli.least_squares import Triangle
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.rotations import body_torque

Columns = Callable[[Motion], Array]


@dataclass(frozen=True)
class Score:
    """Scores of a torque prediction; other fields are described at `Judged`.

    Attributes
    ----------
    r2_body : array, shape (3,)
        The same for body torque, at samples where the pitch is not vertical: it is divided by cos(pitch), and errors
        with it. NaN if no such sample is left.
    """

    mse: Array
    max_error: Array
    relative_error: Array
    r2: Array
    r2_body: Array
    vaf: Array

    @property
    def worst_relative_error(self) -> float:
        """Largest relative error of the axes that have torque; 0 if none has."""
        return float(np.max(self.relative_error[np.isfinite(self.relative_error)], initial=0.0))


def score_of(source: TorqueSource, torque: Callable[[Motion], Array]) -> Score:
    """Compare the predictions of a model with the torque of flights, chunk by chunk.

    Parameters
    ----------
    torque : callable
        Predicts the generalised torque of a motion.
    """
    sums = ScoreSums()
    for data in source.chunks():
        sums.add(data, torque(data.motion))
    return sums.score()


class VarianceExplained:
    """Sums for the share of the variance explained, ``1 - sum e^2 / sum (y - mean y)^2``, chunk by chunk.

    Chan, Golub and LeVeque, The American Statistician 37 (1983), 242 (sums of squares about a mean, pairwise).
    """

    def __init__(self) -> None:
        self._count, self._square = 0, np.zeros(3)
        # Of what is measured, then of the errors.
        self._mean, self._about_mean = np.zeros((2, 3)), np.zeros((2, 3))

    def add(self, measured: Array, error: Array) -> None:
        """Add samples, if any; both arrays have the shape (samples, 3)."""
        if len(measured) == 0:
            return
        values, count = np.stack([measured, error]), self._count + len(measured)
        mean = values.mean(axis=1)
        apart = mean - self._mean
        self._about_mean += ((values - mean[:, None]) ** 2).sum(axis=1) + apart**2 * self._count * len(error) / count
        self._mean, self._count = self._mean + apart * (len(error) / count), count
        self._square = self._square + np.sum(error**2, axis=0)

    @property
    def mean_squared_error(self) -> Array:
        """Mean squared error by channel."""
        return np.asarray(self._square / self._count)

    @property
    def r2(self) -> Array:
        """Share of the variance explained by channel; NaN where the measured channel does not vary."""
        return 1.0 - _ratio(self._square, self._about_mean[0])

    @property
    def vaf(self) -> Array:
        """Variance accounted for by channel: the same of the error about its mean, without its constant part."""
        return 1.0 - _ratio(self._about_mean[1], self._about_mean[0])


class ScoreSums:
    """Sums over samples that a score is made of, chunk by chunk."""

    def __init__(self) -> None:
        """Begin with no samples."""
        self._largest, self._largest_error = np.zeros(3), np.zeros(3)
        self._euler, self._body = VarianceExplained(), VarianceExplained()

    def add(self, data: TorqueData, predicted: Array) -> None:
        """Add samples, and the torque predicted for them."""
        error, attitude = data.torque - predicted, data.motion.attitude
        self._euler.add(data.torque, error)
        known = ~vertical(attitude)
        self._body.add(*(body_torque(attitude[known], torque[known]) for torque in (data.torque, error)))
        self._largest = np.maximum(self._largest, np.max(np.abs(data.torque), axis=0))
        self._largest_error = np.maximum(self._largest_error, np.max(np.abs(error), axis=0))

    def score(self) -> Score:
        """Give the score of all samples so far."""
        return Score(
            mse=self._euler.mean_squared_error,
            max_error=self._largest_error,
            relative_error=_ratio(self._largest_error, self._largest),
            r2=self._euler.r2,
            r2_body=self._body.r2,
            vaf=self._euler.vaf,
        )


def _ratio(numerator: Array, denominator: Array) -> Array:
    safe = np.where(denominator > 0, denominator, 1.0)
    return np.where(denominator > 0, numerator / safe, np.nan)


@dataclass(frozen=True)
class Baseline:
    """A linear model with few parameters; `columns` takes motion to shape (samples, 3, parameters)."""

    name: str
    columns: Columns
    parameters: Array

    def torque(self, motion: Motion) -> Array:
        """Predict the generalised torque, shape (samples, 3), N m."""
        return np.asarray(self.columns(motion) @ self.parameters)


def constant_inertia_columns(motion: Motion) -> Array:
    """Build the columns of a constant symmetric J in ``J qdd``: J11, J22, J33, J12, J13, J23; shape (samples, 3, 6)."""
    return symmetric_columns(motion.acceleration)


def fit_baselines(source: TorqueSource, row_scale: Array, rank_tolerance: float) -> tuple[Baseline, ...]:
    """Fit rigid body, constant inertia and torque zero to the samples learned from, with weights by axis."""
    kinds: tuple[tuple[str, Columns], ...] = (
        ("rigid-body", rigid_columns),
        ("constant-inertia", constant_inertia_columns),
        ("torque-zero", lambda motion: np.zeros((len(motion), 3, 0))),
    )
    return tuple(Baseline(name, columns, _fit(columns, source, row_scale, rank_tolerance)) for name, columns in kinds)


def _fit(columns: Columns, source: TorqueSource, row_scale: Array, rank_tolerance: float) -> Array:
    blocks = ((columns(data.motion) * row_scale[:, None], data.torque * row_scale) for data in source.chunks())
    rows = ((matrix.reshape(torque.size, matrix.shape[2]), torque.reshape(-1)) for matrix, torque in blocks)
    return Triangle.of(rows).solve(rank_tolerance).coefficients
