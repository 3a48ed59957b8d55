"""Checks of channels: constant, clipped, rounded, filtered; axes swapped or missing; gyroscope against attitude."""

from collections.abc import Iterator, Mapping, Sequence
from math import comb, log, pi

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.consistency.findings import Finding
from cpfls_cli.effects.signals import Signals
from cpfls_cli.flightlog.bandwidth import cut_offs, slow_signals
from cpfls_cli.flightlog.repair import SignalTable
from cpfls_cli.flightlog.stretches import clipped
from cpfls_cli.rounding import levelled

AXES = ("x", "y", "z")
SAME = 0.9  # Correlation that noise does not reach over a flight.
_OTHER = 0.5  # Correlation that noise does not hide where the motion is worth a look.
TWICE = 2.0  # Ratio of two sizes that neither noise nor a filter makes: at a correlation of 0.6 noise makes up to 1.7.
BODY_AXES = ("x (roll)", "y (pitch)", "z (yaw)")
"""Names of the body axes in figures and sentences."""
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
            what = f"about body {BODY_AXES[axis]} the body rate is {gain:.3g} times the attitude's derivative{about}"
            scaled.append(Finding(what, remedy, _SENSORS, gain))
    return tuple(unlike), tuple(scaled)


def _one_axis_apart(axis: int, correlation: Array) -> Finding:
    same, instead = float(correlation[axis, axis]), _instead(correlation, axis)
    more = ""
    if same < -SAME:
        more = ", opposite signs"
    elif instead is not None:
        more = f", but {correlation[axis, instead]:.2f} with that about {AXES[instead]}: axes are swapped"
    what = f"about body {BODY_AXES[axis]} the attitude's derivative and the body rate barely agree"
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


_LOWEST_LIMIT_RAD_S = 1.0  # No gyroscope of a multirotor has its limit lower; a common smallest range is 125 deg/s.
# Rounding to this step adds as much noise as a poor gyroscope has.
_COARSE_STEP_RAD_S = 0.02
_ANGLES = ("roll", "pitch", "yaw")
_CHANNEL_WORDS = {
    "attitude": "attitude",
    "body_rate": "gyroscope",
    "velocity": "velocity",
    "acceleration": "acceleration",
    "specific_force": "accelerometer",
    "rotor_speed": "rotor speeds",
}
# A tenth of the noise of the best gyroscopes of multirotors, and a hundredth of their usual resolution.
_NO_NOISE_RAD_S = 2e-5


def channel_warnings(flights: Sequence[Signals]) -> Iterator[str]:
    """Name channels that never change, and a gyroscope that is clipped or coarsely rounded."""
    for name in _channels(flights[0]):
        columns = [columns_[name] for signals in flights if name in (columns_ := _channels(signals))]
        if all(np.ptp(column) == 0 for column in columns):
            yield f"The channel {name} never changes."
    for axis, column in zip(AXES, np.concatenate([signals.body_rate for signals in flights]).T, strict=True):
        if np.ptp(column) == 0:
            continue
        if clipped(column, _LOWEST_LIMIT_RAD_S) or clipped(-column, _LOWEST_LIMIT_RAD_S):
            yield f"The gyroscope about {axis} is clipped at {np.abs(column).max():.3g} rad/s."
        step = float(np.diff(np.unique(column)).min())
        if step > _COARSE_STEP_RAD_S:
            yield f"The gyroscope about {axis} is rounded to steps of {step:.3g} rad/s."


def _channels(signals: Signals) -> Mapping[str, Array]:
    numbered = tuple(str(i + 1) for i in range(len(signals.vehicle.rotors)))
    groups: tuple[tuple[str, tuple[str, ...], Array | None], ...] = (
        ("gyroscope", AXES, signals.body_rate if "body_rate" in signals.available else None),
        ("attitude", _ANGLES, signals.attitude),
        ("velocity", AXES, signals.velocity),
        ("position", AXES, signals.position),
        ("acceleration", AXES, signals.acceleration),
        ("accelerometer", AXES, signals.specific_force),
        ("rotor speed", numbered, signals.rotor_speed),
        ("voltage", ("",), None if signals.voltage is None else signals.voltage[:, None]),
    )
    return {
        f"{group} {label}".strip(): column
        for group, labels, values in groups
        if values is not None
        for label, column in zip(labels, values.T, strict=True)
    }


def known_up_to(signals: Signals) -> dict[str, float]:
    """Find the cut-offs of the low-pass filters that the signals of a flight went through before they were logged.

    Result: signals without a cliff in their spectrum, and those that are updated slower than the clock, are left out.
    """

    def found() -> dict[str, float]:
        names = [name for name in _CHANNEL_WORDS if name != "body_rate" or name in signals.available]
        logged = {name: values for name in names if (values := getattr(signals, name)) is not None}
        return cut_offs(logged, 1 / signals.period, slow_signals(SignalTable(signals.time, logged)))

    return signals.once(known_up_to, found)


def filter_warnings(flights: Sequence[Signals]) -> tuple[str, ...]:
    """Say which channels were low-passed before they were logged, and whether any noise is left to measure a gap by."""
    found: dict[str, list[float]] = {}
    for signals in flights:
        for name, edge in known_up_to(signals).items():
            found.setdefault(name, []).append(edge)
    most = {name: float(np.median(edges)) for name, edges in found.items() if 2 * len(edges) > len(flights)}
    if most:
        edges = ", ".join(f"{_CHANNEL_WORDS[name]} at about {edge:.2g} Hz" for name, edge in most.items())
        return (
            f"The log is low-passed, by import.lowpass_hz or earlier: {edges}. The noise above that is gone, so the "
            "floors come from the noise below it and are less certain. Use raw logs.",
        )
    gyros = [signals.body_rate for signals in flights if "body_rate" in signals.available]
    if gyros and max(least_noise([rate]) for rate in gyros) < _NO_NOISE_RAD_S:
        return (
            "The gyroscope shows less noise than any real one: the log is simulated or was smoothed. The noise floor "
            "is not known; 0.3 % of torque and force is used instead. Use raw logs.",
        )
    return ()


def least_noise(rates: Sequence[Array]) -> float:
    """Estimate the noise of the quietest axis by fifth differences, which hold little of the motion, rad/s."""
    fifth = np.concatenate([np.diff(rate, 5, axis=0) for rate in rates])
    return float(np.sqrt((fifth**2).mean(axis=0).min() / comb(10, 5)))
