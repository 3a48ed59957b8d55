"""From aligned signals to a flight: filter, then rates, accelerations and torques in both coordinates."""

from __future__ import annotations

from dataclasses import fields, replace
from math import pi
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.flightlog.agreement import warn_of_disagreement
from cpfls_cli.flightlog.motion import body_rate_of
from cpfls_cli.flightlog.results import ImportedFlight, LogSignals
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.flightlog.smoothing import derivative, low_pass

_STEEPEST_PITCH = pi / 2 - pi / 180
_LARGEST_REFINEMENT = 10
_FEWEST_SAMPLES = 10


def derive_flight(signals: LogSignals, settings: ImportSettings) -> ImportedFlight:
    """Filter all signals alike and derive rates, accelerations and torques.

    One filter for every signal keeps the torque equation: its linear part holds between filtered signals as it did
    between the raw ones. The result is interpolated to `rate_hz` last.

    Parameters
    ----------
    signals : LogSignals
        With the body torque, aligned.
    settings : ImportSettings
        `lowpass_hz`, `lowpass_order` and `rate_hz`.

    Raises
    ------
    SettingError
        If the cut-off is not below half of the log's rate, or `rate_hz` leaves next to no samples or is more than ten
        times the log's.
    ComputationError
        If the pitch comes within a degree of +-90 degrees, where Euler rates are not defined.

    References
    ----------
    Section 1 of the method's description.
    """
    smooth = _filtered(signals, settings)
    arrays = _arrays(smooth) | _derived(smooth)
    time = smooth.time
    report = replace(signals.report, lowpass_hz=settings.lowpass_hz, warnings=_warnings(signals))
    if settings.rate_hz is not None:
        time = _clock(time, settings.rate_hz, report.log_rate_hz)
        arrays = {name: CubicSpline(smooth.time, values)(time) for name, values in arrays.items()}
        report = replace(
            report,
            rate_hz=settings.rate_hz,
            samples=len(time),
            warnings=report.warnings + _warn_of_aliasing(settings, report.log_rate_hz),
        )
    return ImportedFlight(time=time, report=report, **arrays)


def _warnings(signals: LogSignals) -> tuple[str, ...]:
    if signals.attitude is None or signals.body_rate is None:
        return signals.report.warnings
    return signals.report.warnings + warn_of_disagreement(signals.time, signals.attitude, signals.body_rate)


def _clock(time: Array, rate_hz: float, log_rate_hz: float) -> Array:
    samples = int(time[-1] * rate_hz + 1e-6) + 1
    if rate_hz > _LARGEST_REFINEMENT * log_rate_hz or samples < _FEWEST_SAMPLES:
        raise SettingError(
            "rate_hz",
            f"does not suit {time[-1]:.4g} s of flight at {log_rate_hz:.4g} Hz; at most {_LARGEST_REFINEMENT} times the"
            f" log's rate, and {_FEWEST_SAMPLES} samples at least",
        )
    return np.arange(samples) / rate_hz


def _arrays(signals: LogSignals) -> dict[str, Array]:
    names = {entry.name for entry in fields(signals)} - {"time", "report"}
    return {name: getattr(signals, name) for name in sorted(names) if getattr(signals, name) is not None}


def _filtered(signals: LogSignals, settings: ImportSettings) -> LogSignals:
    rate_hz = signals.report.log_rate_hz
    smooth: dict[str, Any] = {
        name: low_pass(values, rate_hz, settings.lowpass_hz, settings.lowpass_order)
        for name, values in _arrays(signals).items()
    }
    return replace(signals, **smooth)


def _derived(signals: LogSignals) -> dict[str, Array]:
    derived: dict[str, Array] = {}
    body_rate = body_rate_of(signals.time, signals.attitude, signals.body_rate)
    if body_rate is not None:
        derived["body_rate"] = body_rate
    if signals.attitude is None or body_rate is None:
        return derived
    _require_regular(signals.time, signals.attitude)
    attitude_rate = rotations.attitude_rate(signals.attitude, body_rate)
    derived |= {"attitude_rate": attitude_rate, "attitude_acceleration": derivative(signals.time, attitude_rate)}
    if signals.body_torque is not None:
        derived["torque"] = rotations.generalised_torque(signals.attitude, signals.body_torque)
    return derived


def _require_regular(time: Array, attitude: Array) -> None:
    steep = np.flatnonzero(np.abs(attitude[:, 1]) > _STEEPEST_PITCH)
    if len(steep):
        raise ComputationError(
            f"the pitch comes within a degree of +-90 degrees at {time[steep[0]]:.3f} s of the flight, where"
            " Euler rates are not defined: cut that part off with import.crop_s"
        )


def _warn_of_aliasing(settings: ImportSettings, log_rate_hz: float) -> tuple[str, ...]:
    rate, cutoff = settings.rate_hz, settings.lowpass_hz
    if rate is None or rate >= log_rate_hz * 0.99 or (cutoff is not None and cutoff < rate / 2):
        return ()
    return ("the log is thinned without import.lowpass_hz below half of the new rate: noise is folded into the flight",)
