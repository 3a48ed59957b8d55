"""Warnings about a log: values that look wrong, angles in degrees, attitude and body rate that disagree."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import log, pi
from typing import Any

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.repair import SignalTable, count_saturated
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.flightlog.smoothing import derivative, low_pass

_NEVER_SATURATED = {"quaternion", "voltage"}
# A quarter turn, and a margin for noise and filters.
_LARGEST_PITCH = pi / 2 + 0.05
_FULL_TURN = 7.0
_ANGLE_QUANTILE = 0.99
_AXES = ("x (roll)", "y (pitch)", "z (yaw)")
_COMPARED_BELOW_HZ = 5.0
_FILTER_ORDER = 4
_MOVING_RAD_S = 0.1
_MOVING_SHARE = 0.1
_POOR_CORRELATION = 0.6
# At a correlation of 0.6 and a true gain of 1, noise in one of the two changes the ratio of their spreads by 1.7.
_LARGEST_GAIN = 2.0
_DEGREES_PER_RADIAN = 180 / pi
_GAIN_TOLERANCE = 1.3


@dataclass(frozen=True)
class ValueCounts:
    """Bad values by column of the log; columns without are left out.

    Attributes
    ----------
    missing : dict from str to int
        Absent.
    spikes, suspected_spikes : dict from str to int
        Spikes that are interpolated, and spikes that are left alone; one of the two is empty.
    saturated : dict from str to int
        In long runs at an extreme; not of a quaternion or a voltage, and not of rotors at rest.
    """

    missing: dict[str, int]
    spikes: dict[str, int]
    suspected_spikes: dict[str, int]
    saturated: dict[str, int]


def count_values(
    table: SignalTable, spikes: Mapping[str, BoolArray], resting: Mapping[str, BoolArray], settings: ImportSettings
) -> ValueCounts:
    """Count the bad values of each column of the log.

    Parameters
    ----------
    table : Table
        The part that is kept, as logged.
    spikes : mapping from signal name to array of bool, shape (sample, column)
        Where its spikes are.
    resting : mapping from signal name to array of bool, shape (sample,)
        Where no rotor turns, which is not saturated.
    settings : ImportSettings
        The names of the columns, `spike_deviations` and `saturation_samples`.
    """
    counts = _by_column(spikes, settings, lambda column: int(column.sum()))
    repaired = settings.spike_deviations is not None
    return ValueCounts(
        missing=_by_column(table.signals, settings, lambda column: int(np.isnan(column).sum())),
        spikes=counts if repaired else {},
        suspected_spikes={} if repaired else counts,
        saturated=_saturated(table, resting, settings),
    )


def _saturated(table: SignalTable, resting: Mapping[str, BoolArray], settings: ImportSettings) -> dict[str, int]:
    """Count saturated values, but not a quaternion at hover (1), parked rotors (0), or a coarse voltage."""
    length = settings.saturation_samples
    rotors = {name: np.where(rest[:, None], np.nan, table.signals[name]) for name, rest in resting.items()}
    others = {name: signal for name, signal in table.signals.items() if name not in _NEVER_SATURATED | rotors.keys()}
    return _by_column(rotors, settings, lambda column: count_saturated(column, length, rest=0.0)) | _by_column(
        others, settings, lambda column: count_saturated(column, length)
    )


def warn_of_values(counts: ValueCounts) -> tuple[str, ...]:
    """Describe the columns whose suspicious values are used unchanged."""
    saturated = (
        f"column {column} stands at its extreme for {count} samples in all: saturated?"
        for column, count in counts.saturated.items()
    )
    suspected = (
        f"{count} suspected {'spike' if count == 1 else 'spikes'} in column {column}, used as logged: set"
        " import.spike_deviations to interpolate"
        for column, count in counts.suspected_spikes.items()
    )
    return (*saturated, *suspected)


def _by_column(
    signals: Mapping[str, Array | BoolArray], settings: ImportSettings, count: Callable[[Any], int]
) -> dict[str, int]:
    counts = {
        column: count(values)
        for name, signal in settings.signals.items()
        if name in signals
        for column, values in zip(signal.names, signals[name].T, strict=True)
    }
    return {column: number for column, number in counts.items() if number}


def refuse_steep_pitch(signals: Mapping[str, Array]) -> None:
    """Refuse an attitude whose pitch exceeds a quarter turn, which roll, pitch, yaw angles cannot.

    Parameters
    ----------
    signals : mapping from signal name to array, shape (time, column), SI
        Repaired, in the frames of the log.

    Raises
    ------
    InputError
    """
    if "attitude" not in signals:
        return
    largest = float(np.abs(signals["attitude"][:, 1]).max())
    if largest > _LARGEST_PITCH:
        raise InputError(
            f"attitude reaches {largest:.3g} rad of pitch, and no pitch is larger than a quarter turn, 1.57 rad: is"
            " import.signals.attitude.unit deg? Otherwise check the order of its columns, and spikes"
            " (import.spike_deviations)"
        )


def warn_of_angles(signals: Mapping[str, Array]) -> tuple[str, ...]:
    """Warn of roll or yaw beyond a full turn where no gyroscope confirms their unit.

    Parameters
    ----------
    signals : mapping from signal name to array, shape (sample, column), SI
        As logged; absent values are NaN.
    """
    if "attitude" not in signals or {"body_rate", "attitude_rate"} & signals.keys():
        return ()
    # A single spike says nothing about the unit.
    roll, _, yaw = np.nanquantile(np.abs(signals["attitude"]), _ANGLE_QUANTILE, axis=0)
    return tuple(
        f"attitude reaches {angle:.3g} rad of {name}: is import.signals.attitude.unit deg? (good where the angle counts"
        " on over full turns)"
        for name, angle in (("roll", float(roll)), ("yaw", float(yaw)))
        if angle > _FULL_TURN
    )


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
    for factor, name, rate, angle in (
        (_DEGREES_PER_RADIAN, "180/pi", "deg/s", "rad"),
        (1 / _DEGREES_PER_RADIAN, "pi/180", "rad/s", "deg"),
    ):
        if abs(log(gain / factor)) < log(_GAIN_TOLERANCE):
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
    """Correlate column by column; 0 for a constant column."""
    spread = derived.std(axis=0) * measured.std(axis=0)
    together = ((derived - derived.mean(axis=0)) * (measured - measured.mean(axis=0))).mean(axis=0)
    return np.asarray(np.divide(together, spread, out=np.zeros(3), where=spread > 0), dtype=float)
