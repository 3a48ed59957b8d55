"""Channels that look broken by themselves: constant, clipped, or coarsely rounded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects.signals import Signals

# A gyroscope at its limit stays there for several samples, and far longer than at the level just before it; the peak
# of a slow signal that is rounded stays too, but longer at the level before.
_CLIPPED_SAMPLES = 5
_CLIPPED_TO_NEXT = 3
# No gyroscope of a multirotor has its limit lower; a common smallest range is 125 deg/s.
_LOWEST_LIMIT_RAD_S = 1.0
# Rounding to this step adds as much noise as a poor gyroscope has.
_COARSE_STEP_RAD_S = 0.02
_AXES = ("x", "y", "z")
_ANGLES = ("roll", "pitch", "yaw")


def channel_warnings(flights: Sequence[Signals]) -> tuple[str, ...]:
    """Name channels that never change, and a gyroscope that is clipped or coarsely rounded."""
    return (*_constant(flights), *_gyro(np.concatenate([signals.body_rate for signals in flights])))


def _constant(flights: Sequence[Signals]) -> Iterator[str]:
    for name in _columns(flights[0]):
        columns = [found[name] for signals in flights if name in (found := _columns(signals))]
        if all(np.ptp(column) == 0 for column in columns):
            yield f"The channel {name} never changes."


def _columns(signals: Signals) -> Mapping[str, Array]:
    numbered = tuple(str(i + 1) for i in range(len(signals.vehicle.rotors)))
    groups: tuple[tuple[str, tuple[str, ...], Array | None], ...] = (
        ("gyroscope", _AXES, signals.body_rate if "body_rate" in signals.available else None),
        ("attitude", _ANGLES, signals.attitude),
        ("velocity", _AXES, signals.velocity),
        ("position", _AXES, signals.position),
        ("acceleration", _AXES, signals.acceleration),
        ("accelerometer", _AXES, signals.specific_force),
        ("rotor speed", numbered, signals.rotor_speed),
        ("voltage", ("",), None if signals.voltage is None else signals.voltage[:, None]),
    )
    return {
        f"{group} {label}".strip(): column
        for group, labels, values in groups
        if values is not None
        for label, column in zip(labels, values.T, strict=True)
    }


def _gyro(body_rate: Array) -> Iterator[str]:
    for axis, column in zip(_AXES, body_rate.T, strict=True):
        if np.ptp(column) == 0:
            continue
        if _clipped(column) or _clipped(-column):
            yield f"The gyroscope about {axis} is clipped at {np.abs(column).max():.3g} rad/s."
        step = float(np.diff(np.unique(column)).min())
        if step > _COARSE_STEP_RAD_S:
            yield f"The gyroscope about {axis} is rounded to steps of {step:.3g} rad/s."


def _clipped(column: Array) -> bool:
    before, last = np.unique(column)[-2:]
    highest = column == last
    crowded = highest.sum() > _CLIPPED_TO_NEXT * (column == before).sum()
    return bool(crowded and last >= _LOWEST_LIMIT_RAD_S and _longest_run(highest) >= _CLIPPED_SAMPLES)


def _longest_run(mask: BoolArray) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return int(np.max(edges[1::2] - edges[::2]))
