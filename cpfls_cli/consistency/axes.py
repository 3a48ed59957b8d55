"""Two vectors that should be the same: axes swapped, reversed or missing, and the gyroscope beside the attitude."""

from __future__ import annotations

from collections.abc import Iterator
from math import log, pi

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.consistency.findings import Finding

AXES = ("x", "y", "z")
SAME = 0.9
"""Correlation that noise does not reach over a flight."""

_OTHER = 0.5
"""Correlation that noise does not hide where the motion is worth a look."""

TWICE = 2.0
"""Ratio of two sizes that neither noise nor a filter makes: at a correlation of 0.6 noise makes up to 1.7."""

_BODY_AXES = ("x (roll)", "y (pitch)", "z (yaw)")
_TURNING_RAD_S, _TURNING_SHARE = 0.1, 0.1
"""Standard deviation from which on an axis is judged, also as a share of that of the axis which turns most: about one
that hardly turns, errors of the others decide."""

_POOR = 0.6
"""Correlation below which gyroscope and attitude do not show one motion."""

_DEGREES_PER_RADIAN = 180 / pi
_UNIT_TOLERANCE = 1.3
"""Ratio within which a gain is that of a unit."""


def _correlated(first: Array, second: Array) -> Array:
    """Correlate each axis of one with each of the other, shape (3, 3); 0 for what is constant."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num(np.corrcoef(first.T, second.T)[:3, 3:])


def axes_apart(
    words: str, channels: tuple[str, str], first: Array, second: Array, floor: float, remedy: str
) -> list[Finding]:
    """Detect axes that are swapped, reversed or missing.

    Parameters
    ----------
    words : str
        The two channels, "one and other".
    channels : tuple of str
        The same one by one.
    first, second : array, shape (window, 3)
        What should be the same.
    floor : float
        Standard deviation above which something moves.
    remedy : str
    """
    moving = (first.std(axis=0) > floor) & (second.std(axis=0) > 0)
    correlation = _correlated(first, second)
    # Noise on one side that brings the correlation below a half makes that side more than twice as large.
    larger, smaller = (
        np.maximum(first.std(axis=0), second.std(axis=0)),
        np.minimum(first.std(axis=0), second.std(axis=0)),
    )
    alike = (smaller > floor) & (larger < TWICE * smaller)
    findings = []
    for axis in np.flatnonzero(moving):
        same, best = float(correlation[axis, axis]), int(np.argmax(np.abs(correlation[axis])))
        if same < -SAME:
            what = f"{words} have opposite signs along {AXES[axis]}"
        elif abs(same) < _OTHER and abs(correlation[axis, best]) > SAME:
            what = f"{AXES[axis]} of the one is {AXES[best]} of the other in {words}: axes are swapped"
        elif abs(same) < _OTHER and alike[axis]:
            what = f"{words} do not belong together along {AXES[axis]}: their correlation is {same:.2f}"
        else:
            continue
        findings.append(Finding(what, remedy, channels, same))
    return findings


def gyroscope_apart(seen: Array, read: Array) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
    """Hold a gyroscope against the rate by the attitude: one motion, in one unit, about each body axis.

    The gain of an axis that agrees is the ratio of the two standard deviations (reduced major axis regression), for
    either may hold the noise.

    Parameters
    ----------
    seen, read : array, shape (window, 3), rad/s
        The rate by the attitude, and by the gyroscope.

    Returns
    -------
    unlike : tuple of Finding
        One for each axis whose correlation is below 0.6.
    scaled : tuple of Finding
        One for each other axis whose gain is not within 0.5 .. 2.
    """
    motion = np.maximum(seen.std(axis=0), read.std(axis=0))
    moving = np.flatnonzero(motion > max(_TURNING_RAD_S, _TURNING_SHARE * motion.max()))
    correlation = _correlated(seen, read)
    agrees = np.diag(correlation) >= _POOR
    unlike = tuple(_one_axis_apart(int(axis), correlation[axis]) for axis in moving if not agrees[axis])
    gain = {int(axis): float(read[:, axis].std() / seen[:, axis].std()) for axis in moving if agrees[axis]}
    return unlike, tuple(_wrong_gains(gain))


def _one_axis_apart(axis: int, correlation: Array) -> Finding:
    same, best = float(correlation[axis]), int(np.argmax(np.abs(correlation)))
    more = ""
    if same < -SAME:
        more = ", opposite signs"
    elif best != axis and abs(correlation[best]) > SAME:
        more = f", and {correlation[best]:.2f} with that about {AXES[best]}: axes are swapped"
    what = f"about body {_BODY_AXES[axis]} the attitude's derivative and the body rate hardly agree"
    remedy = "check columns, signs and frames of import.signals.attitude (or quaternion) and import.signals.body_rate"
    return Finding(f"{what} (correlation {same:.2f}{more})", remedy, ("attitude", "gyroscope"), same)


def _wrong_gains(gain: dict[int, float]) -> Iterator[Finding]:
    for axis, value in gain.items():
        if not 1 / TWICE <= value <= TWICE:
            what = f"about body {_BODY_AXES[axis]} the body rate is {value:.3g} times the attitude's derivative"
            about, remedy = _unit_of_gain(value)
            yield Finding(what + about, remedy, ("attitude", "gyroscope"), value)


def _unit_of_gain(gain: float) -> tuple[str, str]:
    """Name the mistake with a unit that makes a gain, and what mends it."""
    for factor, name, rate, angle in (
        (_DEGREES_PER_RADIAN, "180/pi", "deg/s", "rad"),
        (1 / _DEGREES_PER_RADIAN, "pi/180", "rad/s", "deg"),
    ):
        if abs(log(gain / factor)) < log(_UNIT_TOLERANCE):
            return (
                f", about {name}",
                f"does the log hold rates in {rate} (import.signals.body_rate.unit, attitude_rate.unit), or angles in "
                f"{angle} (import.signals.attitude.unit)?",
            )
    return "", "check the units of import.signals.body_rate (or attitude_rate) and attitude, and import.time_unit"
