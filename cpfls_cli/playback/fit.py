"""Prediction-error fit: the numbers with which free runs along flights come out closest to what was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import contiguous, jackknife_covariance
from cpfls_cli.errors import ComputationError
from cpfls_cli.gauss_newton import minimised
from cpfls_cli.playback.evaluation import Evaluated
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.groups import JointNumbers
from cpfls_cli.playback.kernels import Loss, MeasuredMotion, errors_of_runs, sensitivities
from cpfls_cli.playback.model import VehicleModel

_SIGNAL_WEIGHTS = (0.0, 0.3, 0.5, 1.0)
"""Of position, velocity, attitude and rate: position follows from velocity, and half of the attitude's error from the
rate's, so that each says less that is new."""

_ROBUST = 0.5
_LEAST = 0.1
"""Error at which the loss turns from square to absolute, in those of "rate stays"; at least a share of their mean."""

_PRIOR = 1e-5
"""Weight of what is believed before the flights, so small that it decides only what they do not tell."""


@dataclass(frozen=True)
class FitWindows:
    """Windows of a flight that runs are compared in.

    Attributes
    ----------
    starts : array of int, shape (window,)
    loss : Loss
        In errors of "rate stays" on windows of the flight, or more for a quiet one (`windows_of`).
    """

    flight: PlaybackFlight
    starts: IntArray
    loss: Loss

    @property
    def horizon(self) -> int:
        """Steps of each window."""
        return len(self.loss.weight)

    @cached_property
    def samples(self) -> IntArray:
        """Samples of the flight in the windows, window by window: only there the weights are needed."""
        return np.asarray((self.starts[:, None] + np.arange(self.horizon + 1)).ravel())

    @cached_property
    def motion(self) -> MeasuredMotion:
        """Motion at these samples."""
        whole = self.flight.motion
        position, velocity, rotation, rate = (np.ascontiguousarray(each[self.samples]) for each in whole[:4])
        return MeasuredMotion(position, velocity, rotation, rate, whole.period)

    @cached_property
    def places(self) -> IntArray:
        """Where the windows start in `samples`."""
        return np.arange(len(self.starts), dtype=np.int64) * (self.horizon + 1)

    @classmethod
    def of(cls, flight: PlaybackFlight, horizon: int, every: int) -> FitWindows:
        """Take every n-th window of a flight.

        Parameters
        ----------
        horizon, every : int
            Samples.
        """
        starts = flight.starts(horizon, every)
        return cls(flight, starts, loss_of(flight, rate_stays(flight, starts, horizon)))


def windows_of(flights: Sequence[PlaybackFlight], horizon_s: float, interval_s: float) -> list[FitWindows]:
    """Take windows of flights, errors weighed so that a lively flight counts more, by the square root.

    A model misses more of a lively flight, but not in proportion: the noise of rotor speeds is there in hover as well.
    In errors of "rate stays" a quiet flight would rule the fit, in plain errors the liveliest.

    Parameters
    ----------
    horizon_s, interval_s : float, s
    """
    periods = [flight.motion.period for flight in flights]
    horizons = [max(1, round(horizon_s / period)) for period in periods]
    starts = [
        flight.starts(horizon, max(1, round(interval_s / period)))
        for flight, horizon, period in zip(flights, horizons, periods, strict=True)
    ]
    scales = [rate_stays(*each) for each in zip(flights, starts, horizons, strict=True)]
    lively = np.array([scale.mean(axis=0) for scale in scales])
    weight = np.sqrt(lively.max(axis=0) / np.where(lively > 0, lively, np.inf))
    return [
        FitWindows(flight, start, loss_of(flight, scale * np.where(own > 0, own, 1.0)))
        for flight, start, scale, own in zip(flights, starts, scales, weight, strict=True)
    ]


def rate_stays(flight: PlaybackFlight, starts: IntArray, horizon: int) -> Array:
    """Compute mean errors of "rate stays": the attitude turns with it, and velocity stays.

    Returns
    -------
    array, shape (horizon, 4), m, m/s, rad, rad/s
    """
    motion, errors = flight.motion, np.zeros((horizon, 4))
    turned = Rotation.from_matrix(motion.rotation[starts])
    for step in range(1, horizon + 1):
        at, elapsed = starts + step, step * motion.period
        moved = motion.position[starts] + elapsed * motion.velocity[starts] - motion.position[at]
        turn = (turned * Rotation.from_rotvec(elapsed * motion.rate[starts])).inv()
        away = (turn * Rotation.from_matrix(motion.rotation[at])).magnitude()
        faster = motion.velocity[starts] - motion.velocity[at]
        spun = motion.rate[starts] - motion.rate[at]
        sizes = (np.linalg.norm(each, axis=1) for each in (moved, faster, spun))
        position, velocity, rate = (float(size.mean()) for size in sizes)
        errors[step - 1] = position, velocity, float(away.mean()), rate
    return errors


def loss_of(flight: PlaybackFlight, scale: Array) -> Loss:
    """Weigh errors by what is expected of a forecast that knows nothing, such as `rate_stays`.

    Parameters
    ----------
    scale : array, shape (horizon, 4), m, m/s, rad, rad/s
    """
    total = np.where(flight.shown & (scale.sum(axis=0) > 0), scale.sum(axis=0), np.inf)
    delta = np.maximum(_ROBUST * np.maximum(scale, _LEAST * scale.mean(axis=0)), 1e-12)
    return Loss(np.array(_SIGNAL_WEIGHTS) / total / delta, delta)


@dataclass(frozen=True)
class Fitted:
    """Numbers fitted to windows.

    Attributes
    ----------
    values : array, shape (number,)
    loss : float
        Mean over windows, without the prior; about 1.1 for rates that stay.
    hessian : array, shape (number, number)
        Gauss-Newton, of the mean loss with the prior, in scales of the numbers.
    """

    free: JointNumbers
    values: Array
    loss: float
    hessian: Array

    @property
    def model(self) -> VehicleModel:
        """Model of the vehicle of the config."""
        return self.free.at(self.values).model

    @property
    def condition_number(self) -> float:
        """Of the numbers in their scales, prior included."""
        eigenvalues = np.linalg.eigvalsh(self.hessian) if len(self.hessian) else np.ones(1)
        return float(eigenvalues[-1] / max(eigenvalues[0], np.finfo(float).tiny))


@dataclass(frozen=True)
class FitPoint:
    """A fit at values of its numbers; see `cpfls_cli.gauss_newton.Point`.

    Attributes
    ----------
    loss : float
        The objective without what was believed before.
    """

    values: Array
    loss: float
    objective: float
    gradient: Array
    hessian: Array

    @classmethod
    def of(
        cls, values: Array, loss: float, gradient: Array, hessian: Array, scale: Array, start: Array, spread: Array
    ) -> FitPoint:
        """Add what was believed before the flights: numbers at their starts, so far from them in their scales."""
        away, belief = (values - start) / scale, _PRIOR / spread**2
        return cls(
            values,
            loss,
            loss + 0.5 * float(belief @ away**2),
            gradient * scale + belief * away,
            hessian * scale[:, None] * scale + np.diag(belief),
        )


def fit(
    free: JointNumbers, windows: Sequence[FitWindows], known: Mapping[str, float], steps: int, tolerance: float
) -> Fitted:
    """Minimise the robust prediction error over windows by a damped Gauss-Newton method within bounds.

    Parameters
    ----------
    known : mapping of str to float
        Values to start from, by name.
    steps : int
        At most.
    tolerance : float
        Relative decrease of the loss below which the fit has come to its end.

    Raises
    ------
    ComputationError
        If the starting values lead nowhere: the loss is not finite.

    References
    ----------
    Ljung, System Identification, section 10.2; Jategaonkar, Flight Vehicle System Identification, chapter 4 (output
    error); Bock 1983 (multiple shooting: each window starts from what was measured).
    """
    low, high = free.lows, free.highs
    point = _evaluated(free, windows, np.clip(free.values(known), low, high))
    if not np.isfinite(point.objective):
        raise ComputationError("the prediction error is not finite at the stated numbers; look at the units of the log")
    point = minimised(partial(_evaluated, free, windows), point, free.scales, (low, high), steps, tolerance)
    return Fitted(free, point.values, point.loss, point.hessian)


class _Evaluations:
    """Numbers at values, evaluated once for each vehicle that flew."""

    def __init__(self, free: JointNumbers, values: Array) -> None:
        self.free, self.values = free, values
        self._known: dict[str, tuple[Evaluated, IntArray]] = {}

    def of(self, flight: PlaybackFlight) -> tuple[Evaluated, IntArray]:
        """Give the evaluation for a flight, and where its numbers stand among all."""
        if flight.group not in self._known:
            own, places = self.free.of_flight(flight)
            self._known[flight.group] = Evaluated.of(own, self.values[places]), places
        return self._known[flight.group]

    def sums(self, window: FitWindows, group: IntArray) -> tuple[float, Array, Array]:
        """Sum loss, gradient and Hessian over windows of a flight; see `window_sums`."""
        evaluated, places = self.of(window.flight)
        loss, own_gradient, own_hessian = window_sums(evaluated, window, group)
        count = len(self.values)
        gradient, hessian = np.zeros((len(own_gradient), count)), np.zeros((len(own_gradient), count, count))
        gradient[:, places] = own_gradient
        hessian[:, places[:, None], places] = own_hessian
        return loss, gradient, hessian


def _evaluated(free: JointNumbers, windows: Sequence[FitWindows], values: Array) -> FitPoint:
    evaluations = _Evaluations(free, values)
    total, gradient, hessian = 0.0, np.zeros(len(values)), np.zeros((len(values), len(values)))
    for window in windows:
        loss, by_group, curvature = evaluations.sums(window, np.zeros(len(window.starts), dtype=np.int64))
        total, gradient, hessian = total + loss, gradient + by_group[0], hessian + curvature[0]
    count = sum(len(window.starts) for window in windows)
    return FitPoint.of(values, total / count, gradient / count, hessian / count, free.scales, free.starts, free.spreads)


def window_sums(evaluated: Evaluated, window: FitWindows, group: IntArray) -> tuple[float, Array, Array]:
    """Sum loss, gradient and Hessian over the windows of a flight.

    Parameters
    ----------
    group : array of int, shape (window,)
        Which sum each window is added to.

    Returns
    -------
    loss : float
    gradient : array, shape (group, number)
    hessian : array, shape (group, number, number)
    """
    flight, count, groups = window.flight, len(evaluated.at.values), int(group.max(initial=0)) + 1
    gradient, hessian = np.zeros((groups, count)), np.zeros((groups, count, count))
    terms = evaluated.rotor_terms(flight, window.samples)
    loss = sensitivities(
        window.motion,
        evaluated.body,
        evaluated.used,
        evaluated.weights(terms),
        evaluated.parameters(flight, window.samples, terms),
        window.loss,
        window.places,
        flight.translates,
        group,
        gradient,
        hessian,
    )
    return float(loss), gradient, np.tril(hessian) + np.tril(hessian, -1).swapaxes(1, 2)


@dataclass(frozen=True)
class Uncertainty:
    """How far the numbers of a fit scatter, from blocks of windows.

    Attributes
    ----------
    covariance : array, shape (number, number)
    determined : array of bool, shape (number,)
        Whether the flights say more of a number than what was believed before.
    """

    covariance: Array
    blocks: int
    determined: BoolArray


BLOCKS = 30
"""Blocks of all flights that a jackknife leaves out: Student's t is 4 % wider than for infinitely many."""

_INFORMED = 10.0
"""Curvature by the flights over that by the prior from which on a number counts as determined."""


def uncertainty(fitted: Fitted, windows: Sequence[FitWindows]) -> Uncertainty:
    """Estimate how far the numbers scatter, from blocks of neighbouring windows.

    Without a block b, windows within which are alike, the fit moves by ``(H - H_b)^-1 g_b``; the covariance is
    ``(n - 1) / n`` times the sum of the squares of these moves about their mean. A block that alone tells of a number
    has drawn the fit to itself, which a fixed ``H^-1`` would not see.

    Parameters
    ----------
    windows : sequence of FitWindows
        Of the flights that it was fitted to.

    References
    ----------
    Bell and McCaffrey 2002; MacKinnon, Nielsen and Webb 2023 (jackknife by cluster); Ljung, section 9.4.
    """
    free = fitted.free
    evaluations, scale = _Evaluations(free, fitted.values), free.scales
    count = sum(len(window.starts) for window in windows)
    sums = []
    for window in windows:
        blocks = max(2, round(BLOCKS * len(window.starts) / count))
        sums.append(evaluations.sums(window, contiguous(len(window.starts), blocks))[1:])
    gradient, hessian = (np.concatenate(each) for each in zip(*sums, strict=True))
    # The prior stays in the difference, so that it can be inverted whatever a block takes with it.
    without = fitted.hessian * count - hessian * scale[:, None] * scale
    moved = np.linalg.solve(without, (gradient * scale)[:, :, None])[:, :, 0]
    covariance = jackknife_covariance(moved * scale)
    belief = _PRIOR / free.spreads**2
    conditional = np.diag(fitted.hessian) - belief
    return Uncertainty(covariance, len(gradient), np.asarray(conditional > _INFORMED * belief))


def window_errors(fitted: Fitted, window: FitWindows) -> Array:
    """Weigh the errors of each window as the fit does, shape (window,): about 1.1 for rates that stay."""
    flight = window.flight
    evaluated, _ = _Evaluations(fitted.free, fitted.values).of(flight)
    errors = np.empty((len(window.starts), window.horizon, 4, 3))
    errors_of_runs(
        window.motion,
        evaluated.body,
        evaluated.used,
        evaluated.weights(evaluated.rotor_terms(flight, window.samples)),
        window.places,
        flight.translates,
        errors,
    )
    return weighed(window.loss, errors)


def weighed(loss: Loss, errors: Array) -> Array:
    """Weigh the errors of runs, shape (run, horizon, 4, 3), as the fit does, shape (run,)."""
    root = np.sqrt(1.0 + (errors**2).sum(axis=3) / loss.delta**2)
    return np.asarray((loss.weight * loss.delta**2 * (root - 1.0)).sum(axis=(1, 2)))


def stays_error(window: FitWindows) -> float:
    """Weigh the mean errors of "rate stays" on windows of a flight as the fit does."""
    weight, delta = window.loss.weight, window.loss.delta
    size = rate_stays(window.flight, window.starts, window.horizon)
    return float((weight * delta**2 * (np.sqrt(1.0 + (size / delta) ** 2) - 1.0)).sum())
