"""Two vectors that should be the same: axes swapped, reversed or missing, and the gyroscope against the attitude."""

from collections.abc import Iterator
from math import log, pi

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.consistency.findings import Finding
from cpfls_cli.rounding import levelled

AXES = ("x", "y", "z")
SAME = 0.9  # Correlation that noise does not reach over a flight.
_OTHER = 0.5  # Correlation that noise does not hide where the motion is worth a look.
TWICE = 2.0  # Ratio of two sizes that neither noise nor a filter makes: at a correlation of 0.6 noise makes up to 1.7.
_BODY_AXES = ("x (roll)", "y (pitch)", "z (yaw)")
TURNING_RAD_S, _TURNING_SHARE = 0.1, 0.1
"""Standard deviation from which on an axis is judged, also as a share of that of the axis which turns most: about one
that hardly turns, errors of the others decide."""

_POOR = 0.6  # Correlation below which gyroscope and attitude do not show one motion.
_SURE_SIGMAS, _OVERLAP = 4.0, 4
"""Standard errors of a correlation from which on it is none by chance, and windows that share a sample."""

_DEGREES_PER_RADIAN = 180 / pi
_UNIT_TOLERANCE = 1.3  # Ratio within which a gain is that of a unit.
_SENSORS = ("attitude", "gyroscope")


def _correlated(first: Array, second: Array) -> Array:
    """Correlate each axis of one with each of the other, shape (3, 3); 0 for what is constant."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num(np.corrcoef(first.T, second.T)[:3, 3:])


def _instead(correlation: Array, axis: int) -> int | None:
    """Find the axis of the other that surely stands in the place of an axis of the one."""
    best = int(np.argmax(levelled(np.abs(correlation[axis]))))
    return best if best != axis and abs(correlation[axis, best]) > SAME else None


def axes_apart(words: str, first: Array, second: Array, floor: float) -> Iterator[tuple[str, float]]:
    """Detect axes that are swapped, reversed or missing.

    `words`: the two channels, "one and other".
    `first`, `second`, shape (window, 3): what should be the same.
    `floor`: standard deviation above which something moves.
    Result: what is wrong, and the correlation along that axis.
    """
    spread, other_spread = first.std(axis=0), second.std(axis=0)
    correlation = _correlated(first, second)
    # Noise on one side that brings the correlation below a half makes that side more than twice as large.
    larger, smaller = np.maximum(spread, other_spread), np.minimum(spread, other_spread)
    alike = (smaller > floor) & (larger < TWICE * smaller)
    for axis in np.flatnonzero((spread > floor) & (other_spread > 0)).tolist():
        same, instead = float(correlation[axis, axis]), _instead(correlation, axis)
        if same < -SAME:
            yield f"{words} have opposite signs along {AXES[axis]}", same
        elif abs(same) < _OTHER and instead is not None:
            yield f"in {words}, {AXES[axis]} of one is {AXES[instead]} of the other: axes are swapped", same
        elif abs(same) < _OTHER and alike[axis]:
            yield f"{words} do not match along {AXES[axis]}: their correlation is {same:.2f}", same


def gyroscope_apart(seen: Array, read: Array) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
    """Hold a gyroscope against the rate by the attitude: one motion, in one unit, about each body axis.

    The gain of an axis that agrees is the ratio of the two standard deviations (reduced major axis regression), for
    either may hold the noise.

    `seen`, `read`, shape (window, 3), rad/s: the rate by the attitude, and by the gyroscope.
    Result `unlike`: one for each axis whose correlation is below 0.6.
    Result `scaled`: one for each axis that agrees whose gain is not within 0.5 .. 2, and for each other one whose gain
    is that of degrees for radians: noise in one of the two brings the correlation down to the ratio of their sizes, and
    so explains no gain beyond its inverse.
    """
    motion = np.maximum(seen.std(axis=0), read.std(axis=0))
    correlation = _correlated(seen, read)
    turning = motion > max(TURNING_RAD_S, _TURNING_SHARE * motion.max())
    sure = _SURE_SIGMAS / np.sqrt(len(seen) / _OVERLAP)
    unlike, scaled = [], []
    for axis in range(3):
        same = float(correlation[axis, axis])
        agrees = bool(turning[axis] and same >= _POOR)
        if turning[axis] and not agrees:
            unlike.append(_one_axis_apart(axis, correlation))
        if not agrees and same < sure:
            continue
        gain = float(read[:, axis].std() / seen[:, axis].std())
        about, remedy = _unit_of_gain(gain, _UNIT_TOLERANCE / (1.0 if agrees else same))
        if about or (agrees and not 1 / TWICE <= gain <= TWICE):
            what = f"about body {_BODY_AXES[axis]} the body rate is {gain:.3g} times the attitude's derivative{about}"
            scaled.append(Finding(what, remedy, _SENSORS, gain))
    return tuple(unlike), tuple(scaled)


def _one_axis_apart(axis: int, correlation: Array) -> Finding:
    same, instead = float(correlation[axis, axis]), _instead(correlation, axis)
    more = ""
    if same < -SAME:
        more = ", opposite signs"
    elif instead is not None:
        more = f", but {correlation[axis, instead]:.2f} with that about {AXES[instead]}: axes are swapped"
    what = f"about body {_BODY_AXES[axis]} the attitude's derivative and the body rate barely agree"
    remedy = "check columns, signs and frames of import.signals.attitude (or quaternion) and import.signals.body_rate"
    return Finding(f"{what} (correlation {same:.2f}{more})", remedy, _SENSORS, same)


def _unit_of_gain(gain: float, tolerance: float) -> tuple[str, str]:
    """Name the mistake with a unit that makes a gain within a ratio, and what mends it."""
    for factor, name, rate, angle in (
        (_DEGREES_PER_RADIAN, "180/pi", "deg/s", "rad"),
        (1 / _DEGREES_PER_RADIAN, "pi/180", "rad/s", "deg"),
    ):
        if abs(log(gain / factor)) < log(tolerance):
            return (
                f", about {name}",
                f"does the log give rates in {rate} (import.signals.body_rate.unit, attitude_rate.unit), or angles in "
                f"{angle} (import.signals.attitude.unit)?",
            )
    return "", "check the units of import.signals.body_rate (or attitude_rate) and attitude, and import.time_unit"
