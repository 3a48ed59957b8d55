"""Checks of single channels: constant, clipped, coarsely rounded, filtered before they were logged."""

from collections.abc import Iterator, Mapping, Sequence
from math import comb

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.consistency.axes import AXES
from cpfls_cli.effects.signals import Signals
from cpfls_cli.flightlog.bandwidth import cut_offs, slow_signals
from cpfls_cli.flightlog.repair import SignalTable
from cpfls_cli.flightlog.stretches import clipped

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
