"""Channels that say the same thing twice: position and velocity, velocity and acceleration, and their frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.windows import Windows

_AXES = "xyz"
# Correlations that noise does not reach over a flight, and that noise does not hide where the motion is worth a look.
_SAME = 0.9
_OTHER = 0.5
_SCALE_OFF = 0.2
_DELAY_OFF_S = 0.03
_R2_FOR_DELAY = 0.8
_GRAVITY_OFF_M_S2 = 3.0


class ChannelMatch(NamedTuple):
    """How the derivative of one channel follows another, about one axis.

    Attributes
    ----------
    channels : str
    axis : str
    scale : float
        Of the second against the first.
    r2 : float
    delay_s : float
        Of the second against the first.
    offset : float
        Mean of the second less that of the first.
    """

    channels: str
    axis: str
    scale: float
    r2: float
    delay_s: float
    offset: float


class _Pair(NamedTuple):
    name: str
    floor: float
    moving: Callable[[Signals], Array | None]
    stated: Callable[[Signals], Array | None]


def _felt(signals: Signals) -> Array | None:
    if signals.specific_force is None or signals.attitude is None:
        return None
    weight = np.array([0.0, 0.0, signals.vehicle.gravity_m_s2])
    return np.asarray(np.einsum("tij,tj->ti", signals.rotation, signals.specific_force) - weight)


_PAIRS = (
    _Pair("position and velocity", 0.2, lambda s: s.position, lambda s: s.velocity),
    _Pair("velocity and acceleration", 0.5, lambda s: s.velocity, lambda s: s.acceleration),
    _Pair("velocity and accelerometer", 0.5, lambda s: s.velocity, _felt),
)


def consistency(flights: Sequence[Signals], windows: Windows) -> tuple[tuple[ChannelMatch, ...], tuple[str, ...]]:
    """Compare channels with the derivatives of others, in weak form."""
    matches: list[ChannelMatch] = []
    warnings: list[str] = []
    for pair in _PAIRS:
        rows = list(_rows(pair, flights, windows))
        if rows:
            first, second, change = (np.concatenate(part) for part in zip(*rows, strict=True))
            own = _matches(pair.name, first, second, change)
            matches += own
            warnings += frame_warnings(pair.name, first, second, pair.floor) or _small_warnings(own)
    return tuple(matches), tuple(warnings)


def _rows(pair: _Pair, flights: Sequence[Signals], windows: Windows) -> Iterator[tuple[Array, Array, Array]]:
    for signals in flights:
        moving, stated = pair.moving(signals), pair.stated(signals)
        if moving is not None and stated is not None and windows.count(len(signals)):
            yield windows.derivative(moving), windows.average(stated), windows.derivative(stated)


def _matches(name: str, first: Array, second: Array, change: Array) -> list[ChannelMatch]:
    # Columns as (time, axis): averages over windows put the axis second already.
    offset = second.mean(axis=0) - first.mean(axis=0)
    a, b, slope = (part - part.mean(axis=0) for part in (first, second, change))
    tiny = np.finfo(float).tiny
    shared = (a * b).sum(axis=0)
    correlation = shared / np.sqrt(np.maximum((a**2).sum(axis=0) * (b**2).sum(axis=0), tiny))
    # Noise on either side pulls one regression down and the other up; their geometric mean lies between.
    scale = np.sign(correlation) * np.sqrt((b**2).sum(axis=0) / np.maximum((a**2).sum(axis=0), tiny))
    delay = ((a - b) * slope).sum(axis=0) / np.maximum((slope**2).sum(axis=0), tiny)
    return [
        ChannelMatch(name, _AXES[i], float(scale[i]), float(correlation[i] ** 2), float(delay[i]), float(offset[i]))
        for i in range(3)
    ]


def frame_warnings(name: str, first: Array, second: Array, floor: float) -> list[str]:
    """Look for an axis that is swapped, turned round or missing.

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
    said = []
    for axis in np.flatnonzero(moving):
        own, best = correlation[axis, axis], int(np.argmax(np.abs(correlation[axis])))
        if own < -_SAME:
            said.append(f"{name} have opposite signs along {_AXES[axis]}")
        elif abs(own) < _OTHER and abs(correlation[axis, best]) > _SAME:
            said.append(f"{_AXES[axis]} of the one is {_AXES[best]} of the other in {name}: axes are swapped")
        elif abs(own) < _OTHER and alike[axis]:
            said.append(f"{name} do not belong together along {_AXES[axis]}: their correlation is {own:.2f}")
    return [f"{sentence[0].upper()}{sentence[1:]}." for sentence in said]


def _small_warnings(matches: Sequence[ChannelMatch]) -> list[str]:
    said = []
    for each in matches:
        if each.r2 > _SAME**2 and _scale_off(each):
            said.append(f"The scales of {each.channels} along {each.axis} differ by a factor of {each.scale:.2f}.")
        elif each.r2 > _R2_FOR_DELAY and abs(each.delay_s) > _DELAY_OFF_S:
            said.append(f"In {each.channels} along {each.axis}, the second is late by {1000 * each.delay_s:.0f} ms.")
        if each.channels != _PAIRS[0].name and abs(each.offset) > _GRAVITY_OFF_M_S2:
            said.append(f"{each.channels.capitalize()} differ by {each.offset:.1f} m/s^2 along {each.axis}: gravity?")
    return said


def _scale_off(match: ChannelMatch) -> bool:
    """Whether the scale is off whichever side the noise is on."""
    either = (match.scale * np.sqrt(match.r2), match.scale / np.sqrt(match.r2))
    return all(each > 1 + _SCALE_OFF for each in either) or all(each < 1 - _SCALE_OFF for each in either)
