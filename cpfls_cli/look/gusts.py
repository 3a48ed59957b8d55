"""Gusts: the angular acceleration that commands do not cause, its size and how long it lasts."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.estimation.spectra import transforms, window_starts
from cpfls_cli.estimation.whittle import most_likely
from cpfls_cli.look.effectiveness import PlantModel
from cpfls_cli.look.flight import AXES, LogFlight
from cpfls_cli.look.steady import FEWEST_WINDOWS, jackknifed
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


def gusts_of(flight: LogFlight, plants: Mapping[str, PlantModel]) -> tuple[AxisGusts, ...]:
    """Estimate the gusts about each axis whose plant is known, from an estimate that gusts do not bias."""
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
    size, memory, in_band = (
        Estimate(value=float(np.exp(each.value)), low=float(np.exp(each.low)), high=float(np.exp(each.high)))
        for each in (known.estimate(k) for k in (0, 1, 3))
    )
    inside = _SEEN_S[0] < memory.low and memory.high < _SEEN_S[1]
    return AxisGusts(axis=AXES[axis], in_band=in_band, size=size if inside else None, memory=memory if inside else None)


def _spectrum(frequency: Array, logs: Array) -> tuple[Array, Array]:
    """Evaluate the spectrum of gusts and noise as windows under Hann's taper show it, and its slopes by logarithms.

    `logs`: of size, memory and noise.
    """
    size, memory, noise = np.exp(logs)
    near = frequency + (frequency[1] - frequency[0]) * np.array(list(_NEIGHBOURS))[:, None]
    turning = 2 * np.pi * near
    late = (turning * memory) ** 2
    gusts, sensor = 4 * size**2 * memory / (1 + late), noise * turning**2
    shares = np.array(list(_NEIGHBOURS.values()))
    slopes = [shares @ each for each in (2 * gusts, gusts * (1 - late) / (1 + late), sensor)]
    return np.asarray(shares @ (gusts + sensor)), np.array(slopes)


def _fitted(frequency: Array, power: Array) -> Array:
    """Fit size, memory and noise to a spectrum; logarithms of them, and of the size within the band."""
    spacing = frequency[1] - frequency[0]
    whole = float(power.sum() * spacing)
    floor = float(np.median(power / (2 * np.pi * frequency) ** 2))
    begin = np.log([np.sqrt(whole), 0.3, 0.1 * floor])
    shortest, longest = np.log(_MEMORY_S)
    ends = [(begin[0] - 6, begin[0] + 3), (shortest, longest), (begin[2] - 12, begin[2] + 6)]

    def spectrum(logs: Array) -> tuple[Array, Callable[[Array], Array]]:
        expected, slopes = _spectrum(frequency, logs)
        return expected, lambda slope: slopes @ slope[0]

    logs = most_likely(spectrum, power[None], [begin], ends)
    size, memory = np.exp(logs[:2])
    # A sum over frequencies would begin below the band, where long gusts are largest.
    band = np.arctan(2 * np.pi * memory * np.array(_BAND_HZ))
    return np.array([*logs, np.log(size) + 0.5 * np.log(2 / np.pi * (band[1] - band[0]))])
