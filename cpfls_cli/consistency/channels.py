"""Checks of single channels, broken or filtered, and of the axes of two."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import comb

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.flightlog.bandwidth import cut_offs, slow_signals
from cpfls_cli.flightlog.repair import SignalTable
from cpfls_cli.flightlog.stretches import clipped

# No gyroscope of a multirotor has its limit lower; a common smallest range is 125 deg/s.
_LOWEST_LIMIT_RAD_S = 1.0
# Rounding to this step adds as much noise as a poor gyroscope has.
_COARSE_STEP_RAD_S = 0.02
AXES = ("x", "y", "z")
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
# Correlations that noise does not reach over a flight, and that noise does not hide where the motion is worth a look.
SAME = 0.9
_OTHER = 0.5


def channel_warnings(flights: Sequence[Signals]) -> tuple[str, ...]:
    """Name channels that never change, and a gyroscope that is clipped or coarsely rounded."""
    return (*_constant(flights), *_gyro_warnings(np.concatenate([signals.body_rate for signals in flights])))


def _constant(flights: Sequence[Signals]) -> Iterator[str]:
    for name in _channels(flights[0]):
        columns = [columns_[name] for signals in flights if name in (columns_ := _channels(signals))]
        if all(np.ptp(column) == 0 for column in columns):
            yield f"The channel {name} never changes."


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


def _gyro_warnings(body_rate: Array) -> Iterator[str]:
    for axis, column in zip(AXES, body_rate.T, strict=True):
        if np.ptp(column) == 0:
            continue
        if clipped(column, _LOWEST_LIMIT_RAD_S) or clipped(-column, _LOWEST_LIMIT_RAD_S):
            yield f"The gyroscope about {axis} is clipped at {np.abs(column).max():.3g} rad/s."
        step = float(np.diff(np.unique(column)).min())
        if step > _COARSE_STEP_RAD_S:
            yield f"The gyroscope about {axis} is rounded to steps of {step:.3g} rad/s."


def frame_warnings(name: str, first: Array, second: Array, floor: float) -> list[str]:
    """Detect axes that are swapped, reversed or missing.

    Parameters
    ----------
    name : str
        The two channels, "one and other".
    first, second : array, shape (window, 3)
        What should be the same.
    floor : float
        Standard deviation above which something moves.
    """
    moving = (first.std(axis=0) > floor) & (second.std(axis=0) > 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = np.nan_to_num(np.corrcoef(first.T, second.T)[:3, 3:])
    # Noise on one side that brings the correlation below a half makes that side more than twice as large.
    larger, smaller = (
        np.maximum(first.std(axis=0), second.std(axis=0)),
        np.minimum(first.std(axis=0), second.std(axis=0)),
    )
    alike = (smaller > floor) & (larger < 2 * smaller)
    sentences = []
    for axis in np.flatnonzero(moving):
        same, best = correlation[axis, axis], int(np.argmax(np.abs(correlation[axis])))
        if same < -SAME:
            sentences.append(f"{name} have opposite signs along {AXES[axis]}")
        elif abs(same) < _OTHER and abs(correlation[axis, best]) > SAME:
            sentences.append(f"{AXES[axis]} of the one is {AXES[best]} of the other in {name}: axes are swapped")
        elif abs(same) < _OTHER and alike[axis]:
            sentences.append(f"{name} do not belong together along {AXES[axis]}: their correlation is {same:.2f}")
    return [f"{sentence[0].upper()}{sentence[1:]}." for sentence in sentences]


def known_up_to(signals: Signals) -> dict[str, float]:
    """Find the cut-offs of the low-pass filters that the signals of a flight went through before they were logged.

    Returns
    -------
    dict from field of `Signals` to float, Hz
        Signals without a cliff in their spectrum, and those that are updated slower than the clock, are left out.
    """
    return signals.once(known_up_to, lambda: _known_up_to(signals))


def _known_up_to(signals: Signals) -> dict[str, float]:
    logged = {name: values for name in _CHANNEL_WORDS if (values := getattr(signals, name)) is not None}
    if "body_rate" not in signals.available:
        del logged["body_rate"]
    return cut_offs(logged, 1 / signals.period, slow_signals(SignalTable(signals.time, logged)))


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
            f"The log is low-passed, by import.lowpass_hz or before: {edges}. The noise above is gone, so floors are "
            "taken from what is below and are less sure. Feed raw logs.",
        )
    gyros = [signals.body_rate for signals in flights if "body_rate" in signals.available]
    if gyros and max(_noise(rate) for rate in gyros) < _NO_NOISE_RAD_S:
        return (
            "The gyroscope shows less noise than any has: the log is simulated or was smoothed. The noise floor is not "
            "known; 0.3 % of torque and force stand for it. Feed raw logs.",
        )
    return ()


def _noise(rate: Array) -> float:
    """Bound the noise of the quietest axis from above by fifth differences, which hold little of the motion, rad/s."""
    return float(np.sqrt((np.diff(rate, 5, axis=0) ** 2).mean(axis=0).min() / comb(10, 5)))
