"""Prediction-error fit: the numbers with which free runs along flights come out closest to what was measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import contiguous, jackknife_covariance
from cpfls_cli.errors import ComputationError
from cpfls_cli.gauss_newton import minimised
from cpfls_cli.playback.evaluation import Evaluated
from cpfls_cli.playback.flight import PlaybackFlight, motion_at
from cpfls_cli.playback.groups import JointNumbers
from cpfls_cli.playback.kernels import NO_PARAMETERS, Loss, MeasuredMotion, errors_of_runs, sensitivities
from cpfls_cli.playback.model import VehicleModel

_SIGNAL_WEIGHTS = (0.0, 0.3, 0.5, 1.0)
"""Of position, velocity, attitude and rate: position follows from velocity, and half of the attitude's error from the
rate's, so that each says less that is new."""

_ROBUST = 0.5
_LEAST = 0.1
"""Error at which the loss turns from square to absolute, in those of "rate stays"; at least a share of their mean."""

PRIOR = 1e-5
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
        return motion_at(self.flight.motion, self.samples)

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
    from scipy.spatial.transform import Rotation

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
class FittedNumbers:
    """Numbers fitted to windows.

    Attributes
    ----------
    values : array, shape (number,)
    loss : float
        Mean over windows, without the prior; about 1.1 for rates that stay.
    """

    free: JointNumbers
    values: Array
    loss: float

    @property
    def model(self) -> VehicleModel:
        """Model of the vehicle of the config."""
        return self.free.at(self.values).model


@dataclass(frozen=True)
class Fitted(FittedNumbers):
    """Numbers fitted to windows, and how well these tell them.

    Attributes
    ----------
    hessian : array, shape (number, number)
        Gauss-Newton, of the mean loss with the prior, in scales of the numbers.
    """

    hessian: Array

    @property
    def condition_number(self) -> float:
        """Of the numbers in their scales, prior included."""
        eigenvalues = np.linalg.eigvalsh(self.hessian) if len(self.hessian) else np.ones(1)
        rounding = np.finfo(float)
        return float(eigenvalues[-1] / max(eigenvalues[0], rounding.eps * eigenvalues[-1], rounding.tiny))


class Believed(NamedTuple):
    """What is believed of numbers before the flights: that they are at their starts, so far away in their scales.

    Attributes
    ----------
    start, scale, spread : array, shape (number,)
    """

    start: Array
    scale: Array
    spread: Array


@dataclass(frozen=True)
class FitPoint:
    """A fit at values of its numbers; see `cpfls_cli.gauss_newton.Point`.

    Attributes
    ----------
    loss : float
        The objective without what was believed before.
    derivatives : callable
        Gives gradient and Hessian of the loss by the numbers. They cost ten times the loss, and a step that fails, or
        is the last one, needs none.
    """

    values: Array
    loss: float
    derivatives: Callable[[], tuple[Array, Array]]
    believed: Believed

    @cached_property
    def objective(self) -> float:
        """Loss, and what was believed before."""
        return self.loss + 0.5 * float(self._belief @ self._away**2)

    @property
    def gradient(self) -> Array:
        """Of the objective, in scales of the numbers."""
        return self._in_scales[0]

    @property
    def hessian(self) -> Array:
        """Of the objective, in scales of the numbers."""
        return self._in_scales[1]

    @property
    def _belief(self) -> Array:
        return np.asarray(PRIOR / self.believed.spread**2)

    @property
    def _away(self) -> Array:
        return (self.values - self.believed.start) / self.believed.scale

    @cached_property
    def _in_scales(self) -> tuple[Array, Array]:
        gradient, hessian = self.derivatives()
        scale, belief = self.believed.scale, self._belief
        return gradient * scale + belief * self._away, hessian * scale[:, None] * scale + np.diag(belief)


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
    return fit_parts(free, [windows], known, steps, tolerance)[0]


def fit_parts(
    free: JointNumbers, parts: Sequence[Sequence[FitWindows]], known: Mapping[str, float], steps: int, tolerance: float
) -> tuple[Fitted, tuple[FittedNumbers, ...]]:
    """Fit numbers to all parts of the windows, and from there, by one step, without each.

    Without a part the derivatives at the fit to all are known: they are those of all less those of the part. Each step
    has to lower the loss without the part. Parameters are those of `fit`; a single part cannot be left out.
    """
    windows = [window for part in parts for window in part]
    place = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    bounds = free.lows, free.highs

    def best(kept: BoolArray, point: FitPoint, steps: int) -> FitPoint:
        own = [window for window, keep in zip(windows, kept, strict=True) if keep]

        def evaluated(values: Array) -> FitPoint:
            return WindowSums(free, own, values).mean()

        return minimised(evaluated, point, free.scales, bounds, steps, tolerance)

    start = WindowSums(free, windows, np.clip(free.values(known), *bounds)).mean()
    if not np.isfinite(start.objective):
        raise ComputationError("the prediction error is not finite with the stated numbers; check the units of the log")
    sums = WindowSums(free, windows, best(place >= 0, start, steps).values)
    losses = sums.losses()
    whole = sums.mean(losses)
    # The derivatives along all windows are taken here, before threads ask for parts of them.
    hessian = whole.hessian

    def without(part: int) -> FittedNumbers:
        kept = place != part
        point = best(kept, sums.mean(losses, kept), 1)
        return FittedNumbers(free, point.values, point.loss)

    with ThreadPoolExecutor(2) as threads:
        found = tuple(threads.map(without, range(len(parts) if len(parts) > 1 else 0)))
    return Fitted(free, whole.values, whole.loss, hessian), found


@dataclass(frozen=True)
class WindowSums:
    """Numbers at values, and what they come to along each of several windows."""

    free: JointNumbers
    windows: Sequence[FitWindows]
    values: Array

    @cached_property
    def _of_groups(self) -> dict[str, tuple[Evaluated, IntArray]]:
        """Evaluate the numbers once for each vehicle that flew, and say where they stand among all."""
        found = {}
        for window in self.windows:
            if window.flight.group not in found:
                own, places = self.free.of_flight(window.flight)
                found[window.flight.group] = Evaluated.of(own, self.values[places]), places
        return found

    def derivatives(self, groups: Sequence[IntArray]) -> list[tuple[Array, Array]]:
        """Sum gradient and Hessian by all numbers along each, shapes (group, number) and (group, number, number)."""

        def of(window: FitWindows, group: IntArray) -> tuple[Array, Array]:
            evaluated, places = self._of_groups[window.flight.group]
            own_gradient, own_hessian = window_sums(evaluated, window, group)[1:]
            count = len(self.values)
            gradient, hessian = np.zeros((len(own_gradient), count)), np.zeros((len(own_gradient), count, count))
            gradient[:, places] = own_gradient
            hessian[:, places[:, None], places] = own_hessian
            return gradient, hessian

        with ThreadPoolExecutor(2) as threads:
            return list(threads.map(of, self.windows, groups))

    @cached_property
    def _by_window(self) -> tuple[Array, Array]:
        none = [np.zeros(len(window.starts), dtype=np.int64) for window in self.windows]
        gradient, hessian = zip(*self.derivatives(none), strict=True)
        return np.concatenate(gradient), np.concatenate(hessian)

    def losses(self) -> Array:
        """Sum the loss along each, shape (windows,)."""
        with ThreadPoolExecutor(2) as threads:
            return np.array(list(threads.map(self._loss, self.windows)))

    def _loss(self, window: FitWindows) -> float:
        return window_loss(self._of_groups[window.flight.group][0], window)

    def mean(self, losses: Array | None = None, kept: BoolArray | slice = slice(None)) -> FitPoint:
        """Take the means over the runs of some of the windows; their losses, where they are known."""
        count = np.array([len(window.starts) for window in self.windows])[kept].sum()

        def derivatives() -> tuple[Array, Array]:
            gradient, hessian = (each[kept].sum(axis=0) / count for each in self._by_window)
            return gradient, hessian

        found = self.losses() if losses is None else losses
        believed = Believed(self.free.starts, self.free.scales, self.free.spreads)
        return FitPoint(self.values, float(found[kept].sum() / count), derivatives, believed)


def window_loss(evaluated: Evaluated, window: FitWindows) -> float:
    """Sum the loss over the windows of a flight."""
    flight = window.flight
    group, none = np.zeros(len(window.starts), dtype=np.int64), np.zeros((1, 0))
    body, used, places, moves = evaluated.body, evaluated.flown, window.places, flight.translates
    weights = evaluated.weights(evaluated.rotor_terms(flight, window.samples), used)
    return float(
        sensitivities(
            window.motion, body, used, weights, NO_PARAMETERS, window.loss, places, moves, group, none, none[:, None]
        )
    )


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
        evaluated.weights(terms, evaluated.used),
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
    free, scale = fitted.free, fitted.free.scales
    count = sum(len(window.starts) for window in windows)
    blocks = [max(2, round(BLOCKS * len(window.starts) / count)) for window in windows]
    groups = [contiguous(len(window.starts), own) for window, own in zip(windows, blocks, strict=True)]
    sums = WindowSums(free, windows, fitted.values).derivatives(groups)
    gradient, hessian = (np.concatenate(each) for each in zip(*sums, strict=True))
    # The prior stays in the difference, so that it can be inverted whatever a block takes with it.
    without = fitted.hessian * count - hessian * scale[:, None] * scale
    moved = np.linalg.solve(without, (gradient * scale)[:, :, None])[:, :, 0]
    covariance = jackknife_covariance(moved * scale)
    belief = PRIOR / free.spreads**2
    conditional = np.diag(fitted.hessian) - belief
    return Uncertainty(covariance, len(gradient), np.asarray(conditional > _INFORMED * belief))


def window_errors(fitted: FittedNumbers, window: FitWindows) -> Array:
    """Weigh the errors of each window as the fit does, shape (window,): about 1.1 for rates that stay."""
    flight = window.flight
    own, places = fitted.free.of_flight(flight)
    evaluated = Evaluated.of(own, fitted.values[places])
    errors = np.empty((len(window.starts), window.horizon, 4, 3))
    errors_of_runs(
        window.motion,
        evaluated.body,
        evaluated.flown,
        evaluated.weights(evaluated.rotor_terms(flight, window.samples), evaluated.flown),
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
