"""A narrow band above the smooth spectrum of a residual, and whether it feeds the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.blocks import mean_error
from cpfls_cli.gap.balance.noise_floor import CORRELATIONS
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.settings import ERRORS

Energy = Literal["feeds", "drains", "neither"]

_LOBE_CYCLES = 2
"""Half width of the main lobe of a Hann taper, in reciprocals of the flight: slower is no band but a drift."""

_FINER = 4  # Frequencies for each reciprocal of the flight: between two, a line loses 2 % of its power.
LOWEST = _FINER * _LOBE_CYCLES  # First bin above those that the mean leaks into.
_MEDIAN_CYCLES = 24  # Width of the running median, six times a line's.


@dataclass(frozen=True)
class NarrowBand:
    """The most significant narrow band."""

    channel: str  # One of `CHANNELS`.
    frequency_hz: float
    share: float  # Of the variance of the channel, above the background.
    # Probability that noise with the same smooth spectrum has a band as prominent, at any frequency of any channel.
    p_value: float
    energy: Energy  # Whether the band feeds energy into the rotation about its axis, drains it, or neither for sure.
    power: float  # Mean of residual times body rate in the band, in the unit of the residual times rad/s; 0 for forces.
    power_error: float  # Its standard error.


def narrow_band(
    residual: Sequence[Array],
    body_rate: Sequence[Array],
    hop_s: float,
    draws: int,
    rng: np.random.Generator,
    significance: float = 1.0,
    least: float = 0.0,
) -> NarrowBand | None:
    """Search for one narrow band above the smooth spectrum of the residual.

    The periodogram over all flights is divided by its background; the largest ratio of all frequencies and channels is
    compared with that of noise drawn from the background. Rows from windows of 0.4 s at a hop of 0.2 s show lines up
    to 2.5 Hz, but those from 2.5 to 5 Hz look like 2.5 to 0 Hz; at a hop of an eighth of the window the windows let
    through nothing that could be mistaken, and lines are seen up to about two periods per window.

    `residual`, each shape (window, 6), N m and N, or floors: of each flight; a channel that a flight lacks is 0.
    `body_rate`, each shape (window, 3), rad/s: over the same windows.
    `hop_s`: from one window to the next, s.
    `draws`: of noise, at most.
    `significance`: largest p that anybody asks for: no noise is drawn once p has to be larger.
    `least`: share of the variance that a band has to exceed: no noise is drawn for less.
    None where no flight is long enough to have a background, all rows are 0, or the band is less.
    Reference: Besag and Clifford 1991, sequential Monte Carlo p-values.
    """
    kept = [number for number, rows in enumerate(residual) if len(rows) > 2 * _MEDIAN_CYCLES and rows.any()]
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
    strongest, peak = (int(i) for i in np.unravel_index(prominence.argmax(), prominence.shape))
    lobe = slice(max(0, peak - LOWEST), peak + LOWEST + 1)
    share = float(np.maximum(power[strongest] - smooth[strongest], 0)[lobe].sum() / power[strongest].sum())
    if not share > least:
        return None
    drawn = reached = 0
    while drawn < draws and 1 + reached <= significance * (1 + draws):
        noise = noise_like(smooth, lengths, present[:, channels], on, rng)
        reached += int(_prominence(noise, on).max() >= prominence.max())
        drawn += 1
    channel, frequency = int(channels[strongest]), _between_bins(power[strongest], peak, on)
    mean, error = _mean_power(channel, frequency, hop_s, flights, rates)
    return NarrowBand(
        channel=CHANNELS[channel],
        frequency_hz=frequency,
        share=share,
        p_value=(1 + reached) / (1 + drawn),
        energy="neither" if not abs(mean) > ERRORS * error else "feeds" if mean > 0 else "drains",
        power=mean,
        power_error=error,
    )


def _prominence(power: Array, on: Grid) -> Array:
    """Divide by the background; 0 at frequencies that are part of the mean."""
    ratio = power / background(power, on)
    ratio[:, :LOWEST] = 0
    return np.asarray(ratio)


def _between_bins(power: Array, peak: int, on: Grid) -> float:
    """Place the peak on the parabola through the logarithms of three bins."""
    if not 0 < peak < len(power) - 1:
        return float(on.frequency[peak])
    left, middle, right = np.log(power[peak - 1 : peak + 2])
    bend = left - 2 * middle + right
    offset = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return float(on.frequency[peak] + np.clip(offset, -1, 1) * on.frequency[1])


def _mean_power(
    channel: int, frequency: float, hop_s: float, residual: Sequence[Array], body_rate: Sequence[Array]
) -> tuple[float, float]:
    """Average residual times rate in the band over segments that resolve it, with the error of the mean."""
    if channel >= body_rate[0].shape[1]:
        return 0.0, 0.0
    length = int(np.ceil(2 * _LOBE_CYCLES / (frequency * hop_s)))
    taper = np.hanning(length + 2)[1:-1]
    wave = np.exp(-2j * np.pi * frequency * hop_s * np.arange(length)) * taper * 2 / taper.sum()
    found = []
    for rows, rate in zip(residual, body_rate, strict=True):
        both = np.stack([rows[:, channel], rate[:, channel]])
        segments = both[:, : len(rate) // length * length].reshape(2, -1, length)
        # Complex amplitudes in the band.
        first, second = (segments - segments.mean(axis=2, keepdims=True)) @ wave
        found.append((first * second.conj()).real / 2)
    products = np.concatenate(found)
    if len(products) < 2:
        return float(products.mean()) if len(products) else 0.0, float(np.inf)
    return float(products.mean()), float(mean_error(products))


@dataclass(frozen=True)
class Grid:
    """Frequencies of the periodograms, four to each reciprocal of the longest flight."""

    samples: int  # To which series are filled up with zeros.
    frequency: Array  # Shape (frequency,), Hz.


def grid(lengths: Sequence[int], period: float) -> Grid:
    """Choose the frequencies for series of different lengths.

    `period`: from one row to the next, s.
    """
    samples = next_fast_len(_FINER * max(lengths), real=True)
    return Grid(samples, rfftfreq(samples, period))


def pooled_power(series: Sequence[Array], on: Grid) -> Array:
    """Sum the periodograms of flights under a Hann taper, shape (..., frequency).

    `series`: each shape (..., time).
    """
    total: Array = np.zeros(())
    for values in series:
        taper = np.hanning(values.shape[-1] + 2)[1:-1]
        tapered = (values - values.mean(axis=-1, keepdims=True)) * taper
        total = total + np.abs(rfft(tapered, on.samples)) ** 2 / (taper**2).sum()
    return np.asarray(total)


def background(power: Array, on: Grid) -> Array:
    """Estimate the smooth spectrum under possible lines.

    The shape of a first-order autoregression times a running median over 24 reciprocals of the flight: the median does
    not see a line, and the shape keeps its edges straight.

    `power`: shape (..., frequency).
    Result: shape (..., frequency); of the median of the power, not of its mean.
    Reference: Mann and Lees 1996, robust estimation of background noise and signal detection.
    """
    turn = np.pi * on.frequency / on.frequency[-1]
    correlation = (power @ np.cos(turn) / power.sum(axis=-1))[..., None]
    # A background is no steeper, or it would be taken for a line at 0.
    correlation = np.clip(correlation, -CORRELATIONS[-1], CORRELATIONS[-1])
    shape = 1 / (1 - 2 * correlation * np.cos(turn) + correlation**2)
    return np.asarray(shape * _running_median(power / shape))


def _running_median(power: Array) -> Array:
    used = power[..., LOWEST:]
    half = min(_MEDIAN_CYCLES * _FINER // 2, used.shape[-1] - 1)
    padded = np.pad(used, [(0, 0)] * (used.ndim - 1) + [(half, half)], mode="reflect")
    # Neighbouring bins are alike, and so are neighbouring medians: a part of them is enough.
    step = 2 * _FINER
    values = np.median(sliding_window_view(padded, 2 * half + 1, axis=-1)[..., ::step, ::2], axis=-1)
    # In straight lines between them, constant beyond the ends.
    inside = np.clip((np.arange(power.shape[-1]) - LOWEST) / step, 0, values.shape[-1] - 1)
    left = np.minimum(inside.astype(int), max(0, values.shape[-1] - 2))
    right = np.minimum(left + 1, values.shape[-1] - 1)
    share = inside - left
    return np.asarray(values[..., left] * (1 - share) + values[..., right] * share)


def noise_like(smooth: Array, lengths: Sequence[int], present: BoolArray, on: Grid, rng: np.random.Generator) -> Array:
    """Draw noise with a background and no line, and pool its periodogram, shape (channel, frequency).

    `smooth`: shape (channel, frequency); `lengths`: of the flights; `present`: shape (flight, channel).
    """
    series = []
    for length, there in zip(lengths, present, strict=True):
        white = rfft(rng.standard_normal((len(smooth), on.samples)))
        series.append(irfft(white * np.sqrt(smooth), on.samples)[:, :length] * there[:, None])
    return pooled_power(series, on)
