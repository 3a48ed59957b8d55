"""Gusts: the angular acceleration that commands do not cause, its size and how long it lasts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.look.flight import AXES, LogFlight, Samples
from cpfls_cli.look.steady import Known, jackknifed, windows_of
from cpfls_cli.result import Estimate, about, part, result

_PIECE_S = 8.0
_BAND_HZ, _OF_RATE = (0.2, 6.0), 0.2
"""Band of the fit: above what a piece resolves, and below where plant and sensors count; share of the sampling rate
it stays below."""
_MEMORY_S, _SEEN_S = (0.02, 5.0), (0.04, 0.8)
"""Time constants that are tried, and what an interval of them has to lie within, for corners in the band."""


class Driven(NamedTuple):
    """What a command does about an axis, b exp(-s delay) / ((s + damping) (1 + s lag)) of it as body rate.

    Attributes
    ----------
    effectiveness : float, rad/s^2 for a full command
    delay_s, lag_s : float, s
    damping : float, 1/s
    """

    effectiveness: float
    delay_s: float
    lag_s: float
    damping: float = 0.0


@result
class AxisGusts:
    """Gusts about one axis: root mean square from 0.2 to 6 Hz, and of the process of first order that has it."""

    axis: str = about("roll, pitch or yaw")
    in_band: Estimate = part()
    size: Estimate | None = part(default=None)
    memory: Estimate | None = part(default=None)
    unexplained: float = about("share of the angular acceleration in the band that commands do not explain")
    frequency: Array = about("frequencies of the fit", "frequency", unit="Hz", brief=False)
    power: Array = about("what commands do not explain", "frequency", unit="(rad/s^2)^2/Hz", brief=False)
    model: Array = about("gusts and noise as fitted", "frequency", unit="(rad/s^2)^2/Hz", brief=False)


def gusts_of(flight: LogFlight, plants: Mapping[str, Driven]) -> tuple[AxisGusts, ...]:
    """Estimate the gusts about each axis whose plant is known.

    Parameters
    ----------
    plants : mapping of str to Driven
        By axis, from an estimate that gusts do not bias (instruments).
    """
    found = (_about(flight, axis, plants[name]) for axis, name in enumerate(AXES) if name in plants)
    return tuple(each for each in found if each)


def _about(flight: LogFlight, axis: int, plant: Driven) -> AxisGusts | None:
    windows = windows_of(flight, _PIECE_S)
    signals = np.stack([flight.body_rate[:, axis], flight.command[:, axis]], axis=1)
    windows = windows.keep(np.asarray(np.isfinite(windows.means(Samples(flight.time, signals))).all(axis=1)))
    if not len(windows.begin):
        return None
    count = round(_PIECE_S * flight.rate_hz)
    first = np.searchsorted(flight.time, windows.begin - 0.5 / flight.rate_hz)
    places = np.minimum(first[:, None] + np.arange(count), len(flight.time) - 1)
    rate, command = (signals[places, k] for k in range(2))
    acceleration = np.gradient(rate, axis=1) * flight.rate_hz
    taper = np.hanning(count)
    frequency = np.asarray(np.fft.rfftfreq(count, 1 / flight.rate_hz), dtype=float)
    band = (frequency >= _BAND_HZ[0]) & (frequency <= min(_BAND_HZ[1], _OF_RATE * flight.rate_hz))
    moved, turned, driven = (
        np.fft.rfft(taper * (each - each.mean(axis=1, keepdims=True)), axis=1)[:, band]
        for each in (acceleration, rate, command)
    )
    slow = 2j * np.pi * frequency[band]
    acts = plant.effectiveness * np.exp(-slow * plant.delay_s) / (1 + slow * plant.lag_s)
    scale = 2 / (flight.rate_hz * float((taper**2).sum()))
    power = scale * np.abs(moved + plant.damping * turned - acts * driven) ** 2
    known = jackknifed(lambda kept: _fitted(frequency[band], power[kept].mean(axis=0)), len(power))
    if known is None:
        return None
    return _described(AXES[axis], known, frequency[band], power.mean(axis=0), scale * np.abs(moved) ** 2)


def _spectrum(frequency: Array, size: float, memory: float, noise: float) -> Array:
    turning = 2 * np.pi * frequency
    return np.asarray(4 * size**2 * memory / (1 + (turning * memory) ** 2) + noise * turning**2)


def _fitted(frequency: Array, power: Array) -> Array:
    """Fit size, memory and noise by the likelihood of a spectrum (Whittle).

    Returns
    -------
    array, shape (4,)
        Logarithms of them, and of the size within the band.
    """
    from scipy.optimize import minimize

    spacing = frequency[1] - frequency[0]
    whole = float(power.sum() * spacing)
    floor = float(np.median(power / (2 * np.pi * frequency) ** 2))

    def unlikely(logs: Array) -> float:
        model = _spectrum(frequency, *np.exp(logs))
        return float(np.sum(np.log(model) + power / model))

    begin = np.log([np.sqrt(whole), 0.3, 0.1 * floor])
    memory = np.log(_MEMORY_S)
    ends = [(begin[0] - 6, begin[0] + 3), (memory[0], memory[1]), (begin[2] - 12, begin[2] + 6)]
    logs = minimize(unlikely, begin, bounds=ends, method="L-BFGS-B").x
    size, memory = np.exp(logs[:2])
    gusts = _spectrum(frequency, float(size), float(memory), 0.0).sum() * spacing
    return np.array([*logs, 0.5 * np.log(gusts)])


def _described(axis: str, known: Known, frequency: Array, power: Array, moved: Array) -> AxisGusts:
    size, memory, in_band = (
        Estimate(value=float(np.exp(each.value)), low=float(np.exp(each.low)), high=float(np.exp(each.high)))
        for each in (known.estimate(k) for k in (0, 1, 3))
    )
    inside = _SEEN_S[0] < memory.low and memory.high < _SEEN_S[1]
    return AxisGusts(
        axis=axis,
        in_band=in_band,
        size=size if inside else None,
        memory=memory if inside else None,
        unexplained=float(power.sum() / moved.mean(axis=0).sum()),
        frequency=frequency,
        power=power,
        model=_spectrum(frequency, *np.exp(known.value[:3])),
    )
