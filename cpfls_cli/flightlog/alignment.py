"""Commands and motion put in step: the commands are shifted by the delay until they act."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from cpfls_cli.arrays import Array
from cpfls_cli.errors import SettingError
from cpfls_cli.flightlog.delay import estimate_delay
from cpfls_cli.flightlog.motion import body_rate_of
from cpfls_cli.flightlog.results import DelayEstimate, LogSignals
from cpfls_cli.flightlog.settings import ImportSettings

_COMMANDS = ("body_torque", "thrust", "rotor_command")
_MOTION = (
    "attitude",
    "body_rate",
    "position",
    "velocity",
    "acceleration",
    "specific_force",
    "rotor_speed",
    "voltage",
)
_POOR_R2 = 0.5


def align_commands(signals: LogSignals, settings: ImportSettings, delay_share: float = 1.0) -> LogSignals:
    """Shift torque, thrust and rotor commands by the delay, stated or estimated, and cut the front that they then miss.

    Measured rotor speeds are motion and stay where they are, unless the torque is computed from them.

    Parameters
    ----------
    signals : LogSignals
        Not yet filtered.
    settings : ImportSettings
        `delay_s`, `delay_max_s`, `torque_source` and the filter that the estimate uses.
    delay_share : float
        Leading share of the samples that the estimate looks at.

    Returns
    -------
    LogSignals
        Time from 0, shorter by the delay.

    Raises
    ------
    SettingError
        If the flight is too short for the estimate, or shorter than the delay; or if the delay is to be estimated and
        body rates or torque are absent.
    ComputationError
        If the torque is constant and the delay is to be estimated.
    """
    estimate = _estimate(signals, settings, delay_share) if settings.delay_s == "estimate" else None
    delay = estimate.delay_s if estimate else float(settings.delay_s)
    report = replace(
        signals.report,
        delay_s=delay,
        delay=estimate,
        warnings=signals.report.warnings + (_warnings(estimate) if estimate else ()),
    )
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
        sentences.append(f"at the estimated delay a rigid body explains only {estimate.pooled_r2:.2f} of the torque")
    if (estimate.inertia[:3] < 0).any():
        sentences.append("at the estimated delay a moment of inertia is negative; check signs and axes")
    return tuple(sentences)


def _shifted(signals: LogSignals, delay: float, speeds_command: bool) -> LogSignals:
    if delay == 0:
        return signals
    period = signals.time[1] - signals.time[0]
    first = int(np.ceil(delay / period - 1e-9))
    if first > len(signals.time) - 2:
        raise SettingError("delay_s", f"longer than the flight, {signals.time[-1]:.4g} s")
    time = signals.time[first:]
    commands = (*_COMMANDS, "rotor_speed") if speeds_command else _COMMANDS
    cut: dict[str, Array] = {}
    for name in (*_COMMANDS, *_MOTION):
        values = getattr(signals, name)
        if values is not None:
            # A monotone interpolant does not overshoot at the steps of a command.
            cut[name] = PchipInterpolator(signals.time, values)(time - delay) if name in commands else values[first:]
    begin, end = signals.report.span_s
    report = replace(signals.report, samples=len(time), span_s=(begin + float(time[0]), end))
    return replace(signals, time=time - time[0], report=report, **cut)
