"""Zero-phase low-pass filter and time derivative of uniformly sampled signals, and body rates from an attitude."""

from functools import cache
from math import ceil

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.errors import SettingError

_PADDED_PERIODS = 3


def low_pass(values: Array, rate_hz: float, cutoff_hz: float | None, order: int) -> Array:
    """Apply a Butterworth low-pass filter of that order forward and backward, without phase shift, to columns.

    The two passes together halve the amplitude at the cut-off (-6 dB), which is below half of the rate; None: nothing
    is changed.
    """
    if cutoff_hz is None:
        return values
    if cutoff_hz >= rate_hz / 2:
        raise SettingError("lowpass_hz", f"is not below half of the log's rate, {rate_hz / 2:.4g} Hz")
    from scipy.signal import sosfiltfilt

    # Turned about its ends, so that level and slope go on while the filter settles.
    padding = min(len(values) - 1, ceil(_PADDED_PERIODS * rate_hz / cutoff_hz))
    sections = _sections(order, cutoff_hz, rate_hz)
    return np.asarray(sosfiltfilt(sections, values.astype(float), axis=0, padlen=padding))


@cache
def _sections(order: int, cutoff_hz: float, rate_hz: float) -> Array:
    """Design a filter once: a log asks hundreds of times for the same, and filtering takes less time than designing."""
    from scipy.signal import butter

    return np.asarray(butter(order, cutoff_hz, fs=rate_hz, output="sos"))


def derivative(time: Array, values: Array) -> Array:
    """Differentiate values, shape (time, column), by the cubic spline through the samples.

    On a uniform clock this is the compact central difference of fourth order: its relative error is
    ``(2 pi f / rate)^4 / 180``, where the plain central difference has ``(2 pi f / rate)^2 / 6`` and would make
    every identified inertia too large. It does not smooth; `low_pass` does.
    """
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(time, values).derivative()(time))


def body_rate_of(time: Array, attitude: Array | None, measured: Array | None) -> Array | None:
    """Take the measured body rates, shape (time, 3), rad/s, or derive them from the attitude, rad, ``W(q) dq/dt``."""
    if measured is not None or attitude is None:
        return measured
    return rotations.body_rate(attitude, derivative(time, attitude))
