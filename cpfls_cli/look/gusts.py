"""Gusts: the angular acceleration that commands do not cause, its size and how long it lasts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.estimation.spectra import transforms, window_starts
from cpfls_cli.look.effectiveness import PlantModel
from cpfls_cli.look.flight import AXES, LogFlight
from cpfls_cli.look.steady import FEWEST_WINDOWS, Known, jackknifed
from cpfls_cli.result import Estimate, about, part, result

_PIECE_S = 8.0
_BAND_HZ, _OF_RATE = (0.2, 6.0), 0.2
"""Band of the fit: above what a piece resolves, and below where plant and sensors count; share of the sampling rate
it stays below."""
_HANN, _NEIGHBOURS = 0.375, {-1: 1 / 6, 0: 2 / 3, 1: 1 / 6}
"""Mean square of Hann's taper, and shares of a frequency and its neighbours in the power that it shows."""
_MEMORY_S, _SEEN_S = (0.02, 5.0), (0.04, 0.8)
"""Time constants that are tried, and what an interval of them has to lie within, for corners in the band."""


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


def gusts_of(flight: LogFlight, plants: Mapping[str, PlantModel]) -> tuple[AxisGusts, ...]:
    """Estimate the gusts about each axis whose plant is known.

    Parameters
    ----------
    plants : mapping of str to PlantModel
        By axis, from an estimate that gusts do not bias (instruments).
    """
    found = (_about(flight, axis, plants[name]) for axis, name in enumerate(AXES) if name in plants)
    return tuple(each for each in found if each)


def _about(flight: LogFlight, axis: int, plant: PlantModel) -> AxisGusts | None:
    signals, period = (flight.body_rate[:, axis], flight.command[:, axis]), 1 / flight.rate_hz
    length = round(_PIECE_S * flight.rate_hz)
    begins = window_starts(flight.usable & np.isfinite(signals).all(axis=0), length)
    # They overlap by half.
    if len(begins) < 2 * FEWEST_WINDOWS - 1:
        return None
    frequency = np.asarray(np.fft.rfftfreq(length, period), dtype=float)
    band = (frequency >= _BAND_HZ[0]) & (frequency <= min(_BAND_HZ[1], _OF_RATE * flight.rate_hz))
    rate, command = map(np.nan_to_num, signals)
    turned, moved = (each[:, band] for each in transforms(rate, begins, length, period, 1))
    driven = transforms(command, begins, length, period)[0][:, band]
    scale = 2 / (_HANN * length * flight.rate_hz)
    power = scale * np.abs(moved + plant.damping * turned - plant.torque(frequency[band]) * driven) ** 2
    known = jackknifed(lambda kept: _fitted(frequency[band], power[kept].mean(axis=0)), len(power))
    if known is None:
        return None
    return _described(AXES[axis], known, frequency[band], power.mean(axis=0), scale * np.abs(moved) ** 2)


def _spectrum(frequency: Array, size: float, memory: float, noise: float) -> Array:
    """Evaluate the spectrum of gusts and noise as windows under Hann's taper show it."""
    near = frequency + (frequency[1] - frequency[0]) * np.array(list(_NEIGHBOURS))[:, None]
    turning = 2 * np.pi * near
    every = 4 * size**2 * memory / (1 + (turning * memory) ** 2) + noise * turning**2
    return np.asarray(np.array(list(_NEIGHBOURS.values())) @ every)


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
    # A sum over frequencies would begin below the band, where long gusts are largest.
    ends = np.arctan(2 * np.pi * memory * np.array(_BAND_HZ))
    return np.array([*logs, np.log(size) + 0.5 * np.log(2 / np.pi * (ends[1] - ends[0]))])


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
