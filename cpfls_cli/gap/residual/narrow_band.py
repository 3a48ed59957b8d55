"""A narrow band that stands out of a residual: its frequency, how sure it is, and whether it feeds the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.residual.spectrum import Grid, background, grid, noise_like, pooled_power

Energy = Literal["feeds", "drains", "neither"]

_FEWEST_ROWS = 64
_LOBE_CYCLES = 2
_PERIODS_PER_SEGMENT = 4
_SURE = 2.0


@dataclass(frozen=True)
class NarrowBand:
    """The narrow band that stands out most.

    Attributes
    ----------
    channel : str
        One of `CHANNELS`.
    frequency_hz : float
    share : float
        Of the variance of the channel, above the background.
    p_value : float
        Probability that noise with the same smooth spectrum has a band as prominent, at any frequency of any channel.
    energy : str
        Whether the band feeds energy into the rotation about its axis, drains it, or neither for sure.
    power : float
        Mean of residual times body rate in the band, in the unit of the residual times rad/s; 0 for forces.
    power_error : float
        Its standard error.
    """

    channel: str
    frequency_hz: float
    share: float
    p_value: float
    energy: Energy
    power: float
    power_error: float


def narrow_band(
    residual: Sequence[Array], body_rate: Sequence[Array], hop_s: float, draws: int, rng: np.random.Generator
) -> NarrowBand | None:
    """Look for one narrow band that stands out of the smooth spectrum of the residual.

    The periodogram over all flights is divided by its background; the largest ratio of all frequencies and channels is
    compared with that of noise drawn from the background. Rows from windows of 0.4 s at a hop of 0.2 s show lines up
    to 2.5 Hz, but those from 2.5 to 5 Hz look like 2.5 to 0 Hz; at a hop of a sixth of the window the windows let
    through nothing that could be mistaken, and lines are seen up to about two periods per window.

    Parameters
    ----------
    residual : sequence of array, shape (window, 6), N m and N, or floors
        Of each flight; a channel that a flight lacks is 0.
    body_rate : sequence of array, shape (window, 3), rad/s
        Over the same windows.
    hop_s : float
        From one window to the next, s.
    draws : int
        Of noise.
    rng : numpy.random.Generator

    Returns
    -------
    NarrowBand or None
        None where no flight has 64 rows, or all rows are 0.
    """
    kept = [number for number, rows in enumerate(residual) if len(rows) >= _FEWEST_ROWS and rows.any()]
    if not kept:
        return None
    flights, rates = [residual[number] for number in kept], [body_rate[number] for number in kept]
    present = np.array([rows.any(axis=0) for rows in flights])
    channels = np.flatnonzero(present.any(axis=0))
    lengths = [len(rows) for rows in flights]
    on = grid(lengths, hop_s)
    power = pooled_power([rows[:, channels].T for rows in flights], on)
    smooth = background(power, on)
    prominence = _prominence(power, on)
    place, peak = (int(i) for i in np.unravel_index(prominence.argmax(), prominence.shape))
    noise = [_prominence(noise_like(smooth, lengths, present[:, channels], on, rng), on).max() for _ in range(draws)]
    channel, frequency = int(channels[place]), _between_bins(power[place], peak, on)
    mean, error = _mean_power(channel, frequency, hop_s, flights, rates)
    return NarrowBand(
        channel=CHANNELS[channel],
        frequency_hz=frequency,
        share=_share(power[place], smooth[place], peak, on),
        p_value=float((1 + (np.array(noise) >= prominence.max()).sum()) / (1 + draws)),
        energy=_energy(mean, error),
        power=mean,
        power_error=error,
    )


def _prominence(power: Array, on: Grid) -> Array:
    """Divide by the background; 0 at frequencies that are part of the mean."""
    ratio = power / background(power, on)
    ratio[:, : on.lowest] = 0
    return np.asarray(ratio)


def _between_bins(power: Array, peak: int, on: Grid) -> float:
    """Place the peak on the parabola through the logarithms of three bins."""
    if not 0 < peak < len(power) - 1:
        return float(on.frequency[peak])
    left, middle, right = np.log(power[peak - 1 : peak + 2])
    bend = left - 2 * middle + right
    offset = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return float(on.frequency[peak] + np.clip(offset, -1, 1) * on.frequency[1])


def _share(power: Array, smooth: Array, peak: int, on: Grid) -> float:
    reach = _LOBE_CYCLES * on.resolution
    lobe = slice(max(0, peak - reach), peak + reach + 1)
    above = np.maximum(power[lobe] - smooth[lobe], 0).sum()
    return float(above / power.sum())


def _mean_power(
    channel: int, frequency: float, hop_s: float, residual: Sequence[Array], body_rate: Sequence[Array]
) -> tuple[float, float]:
    """Average residual times rate in the band over segments of four periods, with the error of the mean."""
    if channel >= body_rate[0].shape[1]:
        return 0.0, 0.0
    length = int(np.ceil(_PERIODS_PER_SEGMENT / (frequency * hop_s)))
    pairs = zip(residual, body_rate, strict=True)
    products = np.concatenate(
        [_products(rows[:, channel], rate[:, channel], length, frequency * hop_s) for rows, rate in pairs]
    )
    if len(products) < 2:
        return float(products.mean()) if len(products) else 0.0, float(np.inf)
    return float(products.mean()), float(products.std(ddof=1) / np.sqrt(len(products)))


def _products(residual: Array, rate: Array, length: int, cycles_per_row: float) -> Array:
    """Average the product of two signals in a band, from their complex amplitudes, shape (segment,)."""
    taper = np.hanning(length + 2)[1:-1]
    wave = np.exp(-2j * np.pi * cycles_per_row * np.arange(length)) * taper * 2 / taper.sum()
    segments = np.stack([residual, rate])[:, : len(rate) // length * length].reshape(2, -1, length)
    first, second = (segments - segments.mean(axis=2, keepdims=True)) @ wave
    return np.asarray((first * second.conj()).real / 2)


def _energy(mean: float, error: float) -> Energy:
    if not abs(mean) > _SURE * error:
        return "neither"
    return "feeds" if mean > 0 else "drains"
