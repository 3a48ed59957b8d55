"""Learners that know nothing of this program: ridge regressions, Gaussian processes, sparse regression by PySINDy.

All learn from one flight and choose what they have to choose on it: by cross-validation over contiguous blocks, the
program's own, or by the marginal likelihood. None is told the yaw angle, which no torque depends on.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, product
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg
from scipy.optimize import minimize

from cpfls_cli.arrays import Array
from cpfls_cli.identification.cross_validation import contiguous_blocks
from cpfls_cli.identification.data import TorqueData, axis_scale
from cpfls_cli.identification.judge import fit_baselines
from cpfls_cli.regressor.motion import Motion

if TYPE_CHECKING:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import Kernel

Torque = Callable[[Motion], Array]
Features = Callable[[Motion], Array]

FOLDS, EMBARGO_S = 5, 0.1
RIDGES = np.geomspace(1e-10, 1e2, 13)
"""Shares of the number of samples, for columns whose mean square is 1."""

THRESHOLDS, DAMPINGS = np.geomspace(1e-2, 0.6, 7), (1e-3, 1e-2)
"""Of sparse regression: shares of the torque's root mean square; ridge strengths as above."""

DEGREES, ORDERS, SPARSE_ORDERS = (2, 3, 4), (2, 3, 4), (2, 3)
TUNED, LEARNED, ROUNDS = 600, 2000, 40
"""Samples that hyperparameters of Gaussian processes are tuned on, and that the processes then learn from."""

FIRST_NOISE = 1e-2


@dataclass(frozen=True)
class Learned:
    """A torque, the error of its cross-validation where there was one, and what was chosen."""

    torque: Torque
    error: float
    chosen: str


def above_rigid_body(flight: TorqueData, learner: Callable[[TorqueData], Learned]) -> Learned:
    """Learn what the rigid body that fits a flight best leaves of its torque."""
    rigid = fit_baselines(flight, np.ones(3), 1e-9)[0].torque
    rest = learner(replace(flight, torque=flight.torque - rigid(flight.motion)))
    return replace(rest, torque=lambda motion: rigid(motion) + rest.torque(motion))


def inputs(motion: Motion) -> Array:
    """Give what a general learner sees: sine and cosine of roll and pitch, rates, accelerations."""
    angles = motion.attitude[:, :2]
    return np.hstack([np.sin(angles), np.cos(angles), motion.rate, motion.acceleration])


def polynomials(degree: int) -> Features:
    """All products of up to so many inputs, each divided by its usual size."""
    from sklearn.preprocessing import PolynomialFeatures

    expand = PolynomialFeatures(degree)
    return lambda motion: expand.fit_transform(inputs(motion) / np.repeat([1.0, 3.0, 6.0], [4, 3, 3]))


def mechanics(order: int) -> Features:
    """Sines and cosines of roll and pitch up to an order, times every acceleration and every product of two rates.

    The torque of every rigid body is such a sum of order 2.
    """

    def features(motion: Motion) -> Array:
        waves = []
        for angle in motion.attitude.T[:2]:
            multiples = angle[:, None] * np.arange(1, order + 1)
            waves.append(np.hstack([np.ones((len(angle), 1)), np.cos(multiples), np.sin(multiples)]))
        pairs = [motion.rate[:, i] * motion.rate[:, j] for i, j in combinations_with_replacement(range(3), 2)]
        terms = np.column_stack([motion.acceleration, *pairs])
        return np.asarray(np.einsum("na,nb,nc->nabc", *waves, terms).reshape(len(terms), -1))

    return features


@dataclass(frozen=True)
class Columns:
    """Features of a flight, scaled to a mean square of 1, and its torque, scaled by axis."""

    flight: TorqueData
    features: Features
    values: Array
    torque: Array
    size: Array
    scale: Array

    @classmethod
    def of(cls, flight: TorqueData, features: Features) -> Columns:
        values = features(flight.motion)
        size = np.sqrt(np.mean(values**2, axis=0))
        size[size == 0] = 1.0
        scale = axis_scale(flight)
        return cls(flight, features, values / size, flight.torque / scale, size, scale)

    def folds(self) -> Iterator[tuple[Array, Array]]:
        """Yield which samples train and which judge, block by block."""
        blocks = contiguous_blocks(self.flight.time, self.flight.time, FOLDS, EMBARGO_S)
        yield from zip(~blocks.left_out, blocks.validation, strict=True)

    def torque_by(self, scaled: Array) -> Torque:
        """Make the torque of weights of the scaled columns."""
        weights, features = scaled * self.scale / self.size[:, None], self.features
        return lambda motion: features(motion) @ weights


def polynomial_ridge(flight: TorqueData) -> Learned:
    """Learn by ridge regression of polynomials of all inputs."""
    return min((_ridge(Columns.of(flight, polynomials(n)), f"degree {n}") for n in DEGREES), key=lambda one: one.error)


def mechanics_ridge(flight: TorqueData) -> Learned:
    """Learn by ridge regression of the terms of mechanics."""
    return min((_ridge(Columns.of(flight, mechanics(n)), f"order {n}") for n in ORDERS), key=lambda one: one.error)


def _ridge(columns: Columns, name: str) -> Learned:
    """Fit with the strength, one for each axis, of the smallest cross-validated error."""
    from sklearn.linear_model import Ridge

    errors = np.mean([_ridge_errors(columns, *fold) for fold in columns.folds()], axis=0)
    strength = RIDGES[np.argmin(errors, axis=0)]
    model = Ridge(alpha=strength * len(columns.values), fit_intercept=False).fit(columns.values, columns.torque)
    torque, strengths = columns.torque_by(model.coef_.T), ", ".join(f"{value:.0e}" for value in strength)
    return Learned(torque, float(errors.min(axis=0).mean()), f"{name}, strength {strengths}")


def _ridge_errors(columns: Columns, training: Array, judging: Array) -> Array:
    """Mean squared errors on one block, shape (strengths, axes): one eigendecomposition serves all strengths."""
    X, y = columns.values[training], columns.torque[training]
    values, vectors = linalg.eigh(X.T @ X, check_finite=False)
    along, seen = vectors.T @ (X.T @ y), columns.values[judging] @ vectors
    errors = []
    for strength in RIDGES:
        predicted = seen @ (along / (np.maximum(values, 0) + strength * len(X))[:, None])
        errors.append(np.mean((columns.torque[judging] - predicted) ** 2, axis=0))
    return np.array(errors)


def sparse(flight: TorqueData) -> Learned:
    """Learn by PySINDy's thresholded least squares on the terms of mechanics."""
    tried = []
    for order in SPARSE_ORDERS:
        columns = Columns.of(flight, mechanics(order))
        blocks = [(_triangle(columns, training), judging) for training, judging in columns.folds()]
        for choice in product(THRESHOLDS, DAMPINGS):
            error = np.mean([_left(columns, _thresholded(*system, *choice), judging) for system, judging in blocks])
            tried.append((float(error), order, choice, columns))
    error, order, choice, columns = min(tried, key=lambda one: one[0])
    weights = _thresholded(*_triangle(columns, np.ones(len(flight), dtype=bool)), *choice)
    threshold, terms = choice[0], np.count_nonzero(weights)
    return Learned(columns.torque_by(weights), error, f"order {order}, threshold {threshold:.2g}, {terms} terms")


def _triangle(columns: Columns, training: Array) -> tuple[Array, Array]:
    """Reduce rows to as many as columns, with the same sums of products: the same least squares, sooner."""
    rows = np.hstack([columns.values[training], columns.torque[training]]) / np.sqrt(np.sum(training))
    triangle = linalg.qr(rows, mode="r", check_finite=False)[0][: rows.shape[1] - 3]
    return triangle[:, :-3], triangle[:, -3:]


def _thresholded(X: Array, y: Array, threshold: float, damping: float) -> Array:
    import pysindy

    with warnings.catch_warnings():
        # It says where a threshold leaves no term, or where twenty rounds do not settle.
        warnings.simplefilter("ignore")
        return np.asarray(pysindy.STLSQ(threshold=threshold, alpha=damping, max_iter=20).fit(X, y).coef_.T)


def _left(columns: Columns, weights: Array, judging: Array) -> float:
    return float(np.mean((columns.torque[judging] - columns.values[judging] @ weights) ** 2))


def gaussian_processes(flight: TorqueData) -> Learned:
    """Learn one Gaussian process for each axis, with a length for each input."""
    scale, seen = axis_scale(flight), inputs(flight.motion)
    learned = np.linspace(0, len(flight) - 1, LEARNED).astype(int)
    tuned = np.sort(np.random.default_rng(3).choice(len(flight), TUNED, replace=False))
    processes = []
    for torque in (flight.torque / scale).T:
        kernel = _tuned(seen[tuned], torque[tuned])
        processes.append(_process(kernel).fit(seen[learned], torque[learned]))

    def predicted(motion: Motion) -> Array:
        at = inputs(motion)
        return np.column_stack([process.predict(at) for process in processes]) * scale

    return Learned(predicted, np.nan, f"{LEARNED} samples, tuned on {TUNED}")


def _process(kernel: Kernel, optimiser: Callable[..., tuple[Array, float]] | None = None) -> GaussianProcessRegressor:
    from sklearn.gaussian_process import GaussianProcessRegressor

    return GaussianProcessRegressor(kernel, alpha=1e-10, optimizer=optimiser)


def _tuned(seen: Array, torque: Array) -> Kernel:
    """Find the kernel of the largest marginal likelihood."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    lengths = RBF(3 * np.std(seen, axis=0), (1e-1, 1e3))
    kernel = ConstantKernel(1.0, (1e-3, 1e4)) * lengths + WhiteKernel(FIRST_NOISE, (1e-9, 2.0))
    with warnings.catch_warnings():
        # It says where an input does not matter.
        warnings.simplefilter("ignore", ConvergenceWarning)
        return _process(kernel, _climb).fit(seen, torque).kernel_


def _climb(objective: Callable[[Array], tuple[float, Array]], start: Array, bounds: Array) -> tuple[Array, float]:
    found = minimize(objective, start, jac=True, bounds=bounds, method="L-BFGS-B", options={"maxiter": ROUNDS})
    return found.x, found.fun
