"""Checks of single channels and of pairs of channels: broken, inconsistent or late."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.flightlog.alignment import estimate_delay
from cpfls_cli.flightlog.results import DelayEstimate
from cpfls_cli.flightlog.stretches import clipped
from cpfls_cli.gap.balance.windows import Windows

# No gyroscope of a multirotor has its limit lower; a common smallest range is 125 deg/s.
_LOWEST_LIMIT_RAD_S = 1.0
# Rounding to this step adds as much noise as a poor gyroscope has.
_COARSE_STEP_RAD_S = 0.02
_AXES = ("x", "y", "z")
_ANGLES = ("roll", "pitch", "yaw")
# Correlations that noise does not reach over a flight, and that noise does not hide where the motion is worth a look.
_SAME = 0.9
_OTHER = 0.5
_SCALE_OFF = 0.2
_DELAY_OFF_S = 0.03
_R2_FOR_DELAY = 0.8
_GRAVITY_OFF_M_S2 = 3.0
# Above the motion of a multirotor and below most of the noise of its derivative.
_LOWPASS_HZ = 8.0
_SHARE_OF_RATE = 0.2
_DELAY_MAX_S = 0.2
# A rigid body that explains less leaves the delay to chance.
_SMALLEST_R2 = 0.3


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


def _gyro_warnings(body_rate: Array) -> Iterator[str]:
    for axis, column in zip(_AXES, body_rate.T, strict=True):
        if np.ptp(column) == 0:
            continue
        if clipped(column, _LOWEST_LIMIT_RAD_S) or clipped(-column, _LOWEST_LIMIT_RAD_S):
            yield f"The gyroscope about {axis} is clipped at {np.abs(column).max():.3g} rad/s."
        step = float(np.diff(np.unique(column)).min())
        if step > _COARSE_STEP_RAD_S:
            yield f"The gyroscope about {axis} is rounded to steps of {step:.3g} rad/s."


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
            pair_matches = _matches(pair.name, first, second, change)
            matches += pair_matches
            warnings += frame_warnings(pair.name, first, second, pair.floor) or _small_warnings(pair_matches)
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
        if same < -_SAME:
            sentences.append(f"{name} have opposite signs along {_AXES[axis]}")
        elif abs(same) < _OTHER and abs(correlation[axis, best]) > _SAME:
            sentences.append(f"{_AXES[axis]} of the one is {_AXES[best]} of the other in {name}: axes are swapped")
        elif abs(same) < _OTHER and alike[axis]:
            sentences.append(f"{name} do not belong together along {_AXES[axis]}: their correlation is {same:.2f}")
    return [f"{sentence[0].upper()}{sentence[1:]}." for sentence in sentences]


def _small_warnings(matches: Sequence[ChannelMatch]) -> list[str]:
    sentences = []
    for each in matches:
        if each.r2 > _SAME**2 and _scale_off(each):
            sentences.append(f"The scales of {each.channels} along {each.axis} differ by a factor of {each.scale:.2f}.")
        elif each.r2 > _R2_FOR_DELAY and abs(each.delay_s) > _DELAY_OFF_S:
            sentences.append(
                f"In {each.channels} along {each.axis}, the second is late by {1000 * each.delay_s:.0f} ms."
            )
        if each.channels != _PAIRS[0].name and abs(each.offset) > _GRAVITY_OFF_M_S2:
            sentences.append(
                f"{each.channels.capitalize()} differ by {each.offset:.1f} m/s^2 along {each.axis}: gravity?"
            )
    return sentences


def _scale_off(match: ChannelMatch) -> bool:
    """Tell whether the scale is off whichever side the noise is on."""
    either = (match.scale * np.sqrt(match.r2), match.scale / np.sqrt(match.r2))
    return all(each > 1 + _SCALE_OFF for each in either) or all(each < 1 - _SCALE_OFF for each in either)


@dataclass(frozen=True)
class ActuationDelay:
    """Delay of the motion behind the logged torque, for information.

    Attributes
    ----------
    commanded : bool
        Whether that torque was commanded, not measured.
    delay_s : float
        Median over the flights, s.
    spread_s : float
        Largest less smallest over the flights, s.
    sentence : str
    """

    commanded: bool
    delay_s: float
    spread_s: float
    sentence: str


def actuation_delay(flights: Sequence[Signals]) -> ActuationDelay | None:
    """Estimate the delay of the motion behind the torque, flight by flight.

    Returns
    -------
    ActuationDelay or None
        None where no flight tells.
    """
    estimates = [(signals.commanded, estimate) for signals in flights if (estimate := _estimate(signals)) is not None]
    if not estimates:
        return None
    delays = [estimate.delay_s for _, estimate in estimates]
    commanded = estimates[0][0]
    delay = float(np.median(delays))
    whom = "commands" if commanded else "measured rotors"
    bound = "at least" if any(estimate.at_bound for _, estimate in estimates) else "about"
    sentence = f"The motion follows the {whom} by {bound} {1000 * delay:.0f} ms."
    return ActuationDelay(commanded, delay, float(np.ptp(delays)), sentence)


def _estimate(signals: Signals) -> DelayEstimate | None:
    if signals.torque is None:
        return None
    lowpass = min(_LOWPASS_HZ, _SHARE_OF_RATE / signals.period)
    try:
        estimate = estimate_delay(
            signals.time, signals.body_rate, signals.torque, delay_max_s=_DELAY_MAX_S, lowpass_hz=lowpass
        )
    except (ComputationError, SettingError):
        return None
    return estimate if estimate.pooled_r2 > _SMALLEST_R2 else None
