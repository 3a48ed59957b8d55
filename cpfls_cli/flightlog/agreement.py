"""Do attitude and gyroscope tell of one motion? Swapped columns, wrong signs and wrong units show where not."""

from __future__ import annotations

from collections.abc import Iterator
from math import log, pi

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.flightlog.smoothing import derivative, low_pass

_AXES = ("x (roll)", "y (pitch)", "z (yaw)")
_COMPARED_BELOW_HZ = 5.0
_FILTER_ORDER = 4
_MOVING_RAD_S = 0.1
_MOVING_SHARE = 0.1
_POOR_CORRELATION = 0.6
# At a correlation of 0.6 and a true gain of 1, noise in one of the two changes the ratio of their spreads by 1.7.
_LARGEST_GAIN = 2.0
_DEGREES = 180 / pi
_NEAR = 1.3


def warn_of_disagreement(time: Array, attitude: Array, body_rate: Array) -> tuple[str, ...]:
    """Compare measured body rates with the derivative of the attitude, ``W(q) dq/dt``, about each body axis.

    Both go through one low-pass filter, for the derivative of an attitude that is logged in steps is mostly noise. An
    axis is judged where either moves by more than 0.1 rad/s and a tenth of the most moving axis (standard deviations):
    about an axis that hardly turns, errors of the others decide. The gain of an axis that agrees is the ratio of the
    two standard deviations (reduced major axis regression), for either may hold the noise.

    Parameters
    ----------
    time : array, shape (time,), s
        Uniform.
    attitude : array, shape (time, 3), rad
        Not filtered yet: the relation between the two is not linear.
    body_rate : array, shape (time, 3), rad/s, body frame
        As measured.

    Returns
    -------
    tuple of str
        A sentence for each axis whose correlation is below 0.6, or else whose gain is not within 0.5 .. 2.
    """
    derived = _slow_part(time, rotations.body_rate(attitude, derivative(time, attitude)))
    measured = _slow_part(time, body_rate)
    correlation, moving = _correlation(derived, measured), np.flatnonzero(_moving(derived, measured))
    poor = correlation < _POOR_CORRELATION
    gain = {int(axis): float(measured[:, axis].std() / derived[:, axis].std()) for axis in moving if not poor[axis]}
    return (*(_contradiction(int(axis), correlation[axis]) for axis in moving if poor[axis]), *_wrong_gains(gain))


def _contradiction(axis: int, correlation: float) -> str:
    return (
        f"about body {_AXES[axis]} the attitude's derivative and the body rate hardly agree (correlation"
        f" {correlation:.2f}): check columns, signs and frames of import.signals.attitude (or quaternion) and"
        " import.signals.body_rate"
    )


def _wrong_gains(gain: dict[int, float]) -> Iterator[str]:
    for axis, value in gain.items():
        if not 1 / _LARGEST_GAIN <= value <= _LARGEST_GAIN:
            yield (
                f"about body {_AXES[axis]} the body rate is {value:.3g} times the attitude's derivative:"
                f" {_explanation(value)}"
            )


def _explanation(gain: float) -> str:
    for factor, name, rate, angle in ((_DEGREES, "180/pi", "deg/s", "rad"), (1 / _DEGREES, "pi/180", "rad/s", "deg")):
        if abs(log(gain / factor)) < log(_NEAR):
            return (
                f"about {name}; does the log hold rates in {rate} (import.signals.body_rate.unit, attitude_rate.unit),"
                f" or angles in {angle} (import.signals.attitude.unit)?"
            )
    return "check the units of import.signals.body_rate (or attitude_rate) and attitude, and import.time_unit"


def _slow_part(time: Array, values: Array) -> Array:
    rate_hz = 1 / float(time[1] - time[0])
    slow = low_pass(values, rate_hz, min(_COMPARED_BELOW_HZ, rate_hz / 5), _FILTER_ORDER)
    # A noisy first or last value is mirrored about itself by the filter and spoils what is near it.
    edge = min(round(rate_hz / _COMPARED_BELOW_HZ), len(slow) // 4)
    return slow[edge : len(slow) - edge]


def _moving(derived: Array, measured: Array) -> BoolArray:
    motion = np.maximum(derived.std(axis=0), measured.std(axis=0))
    moving: BoolArray = motion > max(_MOVING_RAD_S, _MOVING_SHARE * motion.max())
    return moving


def _correlation(derived: Array, measured: Array) -> Array:
    """Correlate column by column; 0 where one stands still."""
    spread = derived.std(axis=0) * measured.std(axis=0)
    together = ((derived - derived.mean(axis=0)) * (measured - measured.mean(axis=0))).mean(axis=0)
    return np.asarray(np.divide(together, spread, out=np.zeros(3), where=spread > 0), dtype=float)
