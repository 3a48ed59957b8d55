"""Commands aligned with the motion: the lag of the rotors, and the delay between torque command and motion."""

from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.flightlog.results import DelayEstimate, LogSignals
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.flightlog.smoothing import body_rate_of, derivative, low_pass
from cpfls_cli.inertia import body_torque_columns
from cpfls_cli.lag import delayed, lagged
from cpfls_cli.rounding import less, levelled

_COMMANDS = ("body_torque", "thrust", "rotor_command")
# Below which most of the torque is other than that of a rigid body, and the delay is not to be trusted.
_POOR_R2 = 0.5
_SMALLEST_WINDOW = 50  # Samples for nine numbers, and for a delay.


def align_commands(signals: LogSignals, settings: ImportSettings, delay_share: float = 1.0) -> LogSignals:
    """Shift torque, thrust and rotor commands by the delay, given or estimated, and drop the samples before it.

    Measured rotor speeds are motion and stay where they are, unless the torque is computed from them.

    Parameters
    ----------
    signals : LogSignals
        Not yet filtered.
    delay_share : float
        Leading share of the samples that the estimate looks at.
    """
    estimate = _estimate(signals, settings, delay_share) if settings.delay_s == "estimate" else None
    delay = estimate.delay_s if estimate else float(settings.delay_s)
    warnings = signals.report.warnings + (_warnings(estimate) if estimate else ())
    report = replace(signals.report, delay_s=delay, delay=estimate, warnings=warnings)
    return _shifted(replace(signals, report=report), delay, settings.torque_source == "rotor-speed")


def _estimate(signals: LogSignals, settings: ImportSettings, share: float) -> DelayEstimate:
    body_rate = body_rate_of(signals.time, signals.attitude, signals.body_rate)
    if body_rate is None or signals.body_torque is None:
        raise SettingError("delay_s", "needs a torque, and body rates or an attitude")
    return estimate_delay(
        signals.time,
        body_rate,
        signals.body_torque,
        delay_max_s=settings.delay_max_s,
        lowpass_hz=settings.lowpass_hz,
        lowpass_order=settings.lowpass_order,
        share=share,
    )


def _warnings(estimate: DelayEstimate) -> tuple[str, ...]:
    sentences = []
    if estimate.at_bound:
        sentences.append("the estimated delay is the longest one tried; raise import.delay_max_s")
    if estimate.pooled_r2 < _POOR_R2:
        sentences.append(f"at the estimated delay, a rigid body explains only {estimate.pooled_r2:.2f} of the torque")
    if (estimate.inertia[:3] < 0).any():
        sentences.append("at the estimated delay, a moment of inertia is negative; check signs and axes")
    return tuple(sentences)


def _shifted(signals: LogSignals, delay: float, speeds_command: bool) -> LogSignals:
    if delay == 0:
        return signals
    period = signals.time[1] - signals.time[0]
    first = int(np.ceil(delay / period - 1e-9))
    if first > len(signals.time) - 2:
        raise SettingError("delay_s", f"longer than the flight, {signals.time[-1]:.4g} s")
    time = signals.time[first:]
    cut = {name: values[first:] for name, values in signals.arrays.items()}
    for name in (*_COMMANDS, "rotor_speed") if speeds_command else _COMMANDS:
        if name in cut:
            # A cubic overshoots the steps of a command; it stays within what was commanded.
            values = signals.arrays[name]
            moved = np.clip(delayed(values, delay / period), values.min(axis=0), values.max(axis=0))
            cut[name] = moved[first:]
    begin, end = signals.report.span_s
    report = replace(signals.report, samples=len(time), span_s=(begin + float(time[0]), end))
    setpoints = {name: values[first:] for name, values in signals.setpoints.items()}
    return replace(signals, time=time - time[0], report=report, setpoints=setpoints, **cut)


@dataclass(frozen=True)
class _Fit:
    """Regression of the shifted torque on the columns of a rigid body."""

    window: slice
    period: float
    torque: Array
    scale: Array
    regressor: Array
    basis: Array

    def scaled_torque(self, delay: float) -> Array:
        moved = delayed(self.torque, delay / self.period)[self.window] / self.scale
        return np.asarray(moved - moved.mean(axis=0))

    def r2(self, delay: float) -> tuple[float, Array]:
        torque = self.scaled_torque(delay)
        fitted = (self.basis @ (self.basis.T @ torque.ravel())).reshape(torque.shape)
        residual, total = ((torque - fitted) ** 2).sum(axis=0), (torque**2).sum(axis=0)
        acting = total > 0
        unexplained = residual[acting] / total[acting]
        r2 = np.ones(3)
        r2[acting] = 1 - unexplained
        return float(1 - np.prod(unexplained) ** (1 / len(unexplained))), r2


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
    """Estimate the delay at which a rigid body explains most of the torque.

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
    share : float
        Leading share of the samples that is looked at, so that data held out for a test stay unseen.

    References
    ----------
    Section 8 of the method's description.
    """
    from scipy.optimize import minimize_scalar

    used = slice(0, round(share * len(time)))
    fit = _prepare(time[used], body_rate[used], body_torque[used], delay_max_s, lowpass_hz, lowpass_order)
    delays = np.append(np.arange(0.0, delay_max_s, time[1] - time[0]), delay_max_s)
    curve = np.array([fit.r2(delay)[0] for delay in delays])
    best = int(np.argmin(levelled(-curve)))
    bounds = delays[max(best - 1, 0)], delays[min(best + 1, len(delays) - 1)]
    refined = float(minimize_scalar(lambda own: -fit.r2(float(own))[0], bounds=bounds, method="bounded").x)
    delay = refined if less(fit.r2(float(delays[best]))[0], fit.r2(refined)[0]) else float(delays[best])
    pooled, r2 = fit.r2(delay)
    inertia = np.linalg.lstsq(fit.regressor, fit.scaled_torque(delay).ravel(), rcond=None)[0]
    return DelayEstimate(
        delay_s=delay,
        r2=r2,
        pooled_r2=pooled,
        inertia=np.asarray(inertia, dtype=float),
        delays=delays,
        curve=curve,
        at_bound=bool(delay > delays[-2]),
    )


def _prepare(
    time: Array, body_rate: Array, body_torque: Array, delay_max_s: float, lowpass_hz: float | None, order: int
) -> _Fit:
    if len(time) < 2:
        raise ComputationError("the delay cannot be estimated: fewer than two samples are in the part used for it")
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
    # Of columns of one length, so that a weakly excited one is not lost.
    lengths = np.linalg.norm(regressor, axis=0)
    directions, sizes, _ = np.linalg.svd(regressor / np.where(lengths > 0, lengths, 1.0), full_matrices=False)
    return _Fit(window, 1 / rate_hz, smooth_torque, scale, regressor, directions[:, sizes > 1e-10 * sizes[0]])


def _window(time: Array, delay_max_s: float, lowpass_hz: float | None) -> slice:
    """Exclude the filter's transients and, at the start, the longest delay."""
    edge = 0.0 if lowpass_hz is None else 0.5 / lowpass_hz
    first, last = np.searchsorted(time, [time[0] + delay_max_s + edge, time[-1] - edge])
    if last - first < _SMALLEST_WINDOW:
        raise SettingError(
            "delay_max_s",
            f"too long to estimate a delay on {time[-1] - time[0]:.3g} s of flight: {max(last - first, 0)} samples"
            f" remain, and at least {_SMALLEST_WINDOW} are needed",
        )
    return slice(int(first), int(last))


def apply_rotor_lag(signals: LogSignals, time_constant: float) -> LogSignals:
    """Replace rotor commands by their first-order response in tau s, ``tau w' + w = u``, u held between samples."""
    command = signals.rotor_command
    if command is None or time_constant == 0:
        return signals
    ratio = time_constant / (signals.time[1] - signals.time[0])
    return replace(signals, rotor_command=lagged(command, ratio, "previous").start)
