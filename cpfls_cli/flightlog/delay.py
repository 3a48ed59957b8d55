"""The delay between a torque command and the motion, by the fit of the rigid-body equation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.flightlog.results import DelayEstimate
from cpfls_cli.flightlog.smoothing import derivative, low_pass
from cpfls_cli.inertia import body_torque_columns

_SMALLEST_WINDOW = 50


@dataclass(frozen=True)
class _Fit:
    """The regression that every delay is judged by; only the torque moves."""

    time: Array
    torque: CubicSpline
    scale: Array
    regressor: Array
    basis: Array

    def scaled_torque(self, delay: float) -> Array:
        moved = self.torque(self.time - delay) / self.scale
        centred: Array = moved - moved.mean(axis=0)
        return centred

    def r2(self, delay: float) -> tuple[float, Array]:
        torque = self.scaled_torque(delay)
        fitted = (self.basis @ (self.basis.T @ torque.ravel())).reshape(torque.shape)
        left, whole = ((torque - fitted) ** 2).sum(axis=0), (torque**2).sum(axis=0)
        acting = whole > 0
        unexplained = left[acting] / whole[acting]
        r2 = np.ones(3)
        r2[acting] = 1 - unexplained
        return float(1 - np.prod(unexplained) ** (1 / len(unexplained))), r2

    def inertia(self, delay: float) -> Array:
        solution = np.linalg.lstsq(self.regressor, self.scaled_torque(delay).ravel(), rcond=None)[0]
        return np.asarray(solution, dtype=float)


def estimate_delay(
    time: Array,
    body_rate: Array,
    body_torque: Array,
    *,
    delay_max_s: float = 0.2,
    lowpass_hz: float | None = None,
    lowpass_order: int = 4,
    share: float = 1.0,
) -> DelayEstimate:
    """Find the delay at which a rigid body explains most of the torque.

    Both sides of ``tau(t - delay) = I omegad + omega x I omega + constant`` go through the same low-pass filter.
    For every delay, the six inertia parameters and a constant torque about each axis are regressed on one common
    window, each axis scaled by its own standard deviation. Delays are judged by the geometric mean, over the axes, of
    the share of torque that stays unexplained: the likelihood where every axis has noise of its own size, so that an
    axis which the motion hardly explains does not move the delay of the others. The best delay on a grid of one
    sample is refined between its neighbours.

    Parameters
    ----------
    time : array, shape (time,), s
        Uniform.
    body_rate : array, shape (time, 3), rad/s, body frame
    body_torque : array, shape (time, 3), N m, body frame
        As commanded, or as computed from the rotors.
    delay_max_s : float
        Longest delay tried, s.
    lowpass_hz : float or None
        Cut-off of the filter, Hz.
    lowpass_order : int
        Its order.
    share : float
        Leading share of the samples that is looked at, so that data held out for a test stay unseen.

    Raises
    ------
    SettingError
        If the longest delay leaves too few samples.
    ComputationError
        If the torque is constant, or the share holds no samples.

    References
    ----------
    Section 8 of the method's description.
    """
    used = slice(0, round(share * len(time)))
    fit = _prepare(time[used], body_rate[used], body_torque[used], delay_max_s, lowpass_hz, lowpass_order)
    delays = np.arange(0.0, delay_max_s, time[1] - time[0])
    delays = np.append(delays, delay_max_s)
    curve = np.array([fit.r2(delay)[0] for delay in delays])
    delay = _refine(fit, delays, int(np.argmax(curve)))
    pooled, r2 = fit.r2(delay)
    at_bound = bool(delay > delays[-2])
    return DelayEstimate(delay, r2, pooled, fit.inertia(delay), delays, curve, at_bound)


def _prepare(
    time: Array, body_rate: Array, body_torque: Array, delay_max_s: float, lowpass_hz: float | None, order: int
) -> _Fit:
    if len(time) < 2:
        raise ComputationError("the delay cannot be estimated: fewer than two samples are in the share to look at")
    rate_hz = 1 / (time[1] - time[0])
    smooth_rate = low_pass(body_rate, rate_hz, lowpass_hz, order)
    smooth_torque = low_pass(body_torque, rate_hz, lowpass_hz, order)
    window = _window(time, delay_max_s, lowpass_hz)
    scale = smooth_torque[window].std(axis=0)
    if not scale.any():
        raise ComputationError("the delay cannot be estimated: the torque is constant")
    scale[scale == 0] = np.inf
    columns = body_torque_columns(smooth_rate, derivative(time, smooth_rate))[window] / scale[:, None]
    regressor = (columns - columns.mean(axis=0)).reshape(-1, 6)
    return _Fit(time[window], CubicSpline(time, smooth_torque), scale, regressor, _orthonormal(regressor))


def _window(time: Array, delay_max_s: float, lowpass_hz: float | None) -> slice:
    """Leave out the filter's transients, and at the front what the longest delay reaches for."""
    edge = 0.0 if lowpass_hz is None else 0.5 / lowpass_hz
    first, last = np.searchsorted(time, [time[0] + delay_max_s + edge, time[-1] - edge])
    if last - first < _SMALLEST_WINDOW:
        raise SettingError(
            "delay_max_s",
            f"too long to estimate a delay on {time[-1] - time[0]:.3g} s of flight: {max(last - first, 0)} samples"
            f" remain, and at least {_SMALLEST_WINDOW} must",
        )
    return slice(int(first), int(last))


def _orthonormal(regressor: Array) -> Array:
    """Span the regressor's columns, scaled first so that a weakly excited one is not taken for rounding."""
    lengths = np.linalg.norm(regressor, axis=0)
    left, sizes, _ = np.linalg.svd(regressor / np.where(lengths > 0, lengths, 1.0), full_matrices=False)
    basis: Array = left[:, sizes > 1e-10 * sizes[0]]
    return basis


def _refine(fit: _Fit, delays: Array, best: int) -> float:
    low, high = delays[max(best - 1, 0)], delays[min(best + 1, len(delays) - 1)]
    found = minimize_scalar(lambda delay: -fit.r2(float(delay))[0], bounds=(low, high), method="bounded")
    refined, on_grid = float(found.x), float(delays[best])
    return refined if fit.r2(refined)[0] > fit.r2(on_grid)[0] else on_grid
