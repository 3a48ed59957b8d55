"""Periodograms of residuals pooled over flights, and the smooth background under them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from cpfls_cli.arrays import Array, BoolArray

_FINER = 4
_LOWEST_CYCLES = 2
_MEDIAN_CYCLES = 24
_STRONGEST_CORRELATION = 0.95


@dataclass(frozen=True)
class Grid:
    """Frequencies of the periodograms, four to each reciprocal of the longest flight.

    Attributes
    ----------
    samples : int
        To which series are filled up with zeros.
    frequency : array, shape (frequency,), Hz
    resolution : int
        Bins in the reciprocal of the longest flight.
    lowest : int
        First bin that is no part of the mean.
    """

    samples: int
    frequency: Array
    resolution: int = _FINER
    lowest: int = _FINER * _LOWEST_CYCLES


def grid(lengths: Sequence[int], period: float) -> Grid:
    """Choose the frequencies for series of different lengths.

    Parameters
    ----------
    lengths : sequence of int
    period : float
        From one row to the next, s.
    """
    samples = next_fast_len(_FINER * max(lengths), real=True)
    return Grid(samples, rfftfreq(samples, period))


def pooled_power(series: Sequence[Array], on: Grid) -> Array:
    """Add up the periodograms of flights under a Hann taper.

    Parameters
    ----------
    series : sequence of array, shape (..., time)
    on : Grid

    Returns
    -------
    array, shape (..., frequency)
    """
    return np.asarray(sum(_power(values, on) for values in series))


def _power(values: Array, on: Grid) -> Array:
    taper = np.hanning(values.shape[-1] + 2)[1:-1]
    tapered = (values - values.mean(axis=-1, keepdims=True)) * taper
    return np.asarray(np.abs(rfft(tapered, on.samples)) ** 2 / (taper**2).sum())


def background(power: Array, on: Grid) -> Array:
    """Estimate the smooth spectrum under possible lines.

    The shape of a first-order autoregression times a running median over 24 reciprocals of the flight: the median does
    not see a line, and the shape keeps its edges straight.

    Parameters
    ----------
    power : array, shape (..., frequency)
    on : Grid

    Returns
    -------
    array, shape (..., frequency)
        Of the median of the power, not of its mean.

    References
    ----------
    Mann and Lees 1996, robust estimation of background noise and signal detection.
    """
    turn = np.pi * on.frequency / on.frequency[-1]
    correlation = (power @ np.cos(turn) / power.sum(axis=-1))[..., None]
    correlation = np.clip(correlation, -_STRONGEST_CORRELATION, _STRONGEST_CORRELATION)
    shape = 1 / (1 - 2 * correlation * np.cos(turn) + correlation**2)
    return np.asarray(shape * _running_median(power / shape, on))


def _running_median(power: Array, on: Grid) -> Array:
    used = power[..., on.lowest :]
    half = min(_MEDIAN_CYCLES * on.resolution // 2, used.shape[-1] - 1)
    padded = np.pad(used, [(0, 0)] * (used.ndim - 1) + [(half, half)], mode="reflect")
    # Neighbouring bins are alike, and so are neighbouring medians: a part of them is enough.
    step = 2 * on.resolution
    views = sliding_window_view(padded, 2 * half + 1, axis=-1)[..., ::step, ::2]
    return _between(np.median(views, axis=-1), (np.arange(power.shape[-1]) - on.lowest) / step)


def _between(values: Array, place: Array) -> Array:
    """Interpolate along the last axis at fractional places, constant beyond the ends."""
    inside = np.clip(place, 0, values.shape[-1] - 1)
    left = np.minimum(inside.astype(int), max(0, values.shape[-1] - 2))
    right = np.minimum(left + 1, values.shape[-1] - 1)
    share = inside - left
    return np.asarray(values[..., left] * (1 - share) + values[..., right] * share)


def noise_like(smooth: Array, lengths: Sequence[int], present: BoolArray, on: Grid, rng: np.random.Generator) -> Array:
    """Draw noise with a background and no line, and pool its periodogram.

    Parameters
    ----------
    smooth : array, shape (channel, frequency)
    lengths : sequence of int
        Of the flights.
    present : array of bool, shape (flight, channel)
    on : Grid
    rng : numpy.random.Generator

    Returns
    -------
    array, shape (channel, frequency)
    """
    series = []
    for length, there in zip(lengths, present, strict=True):
        white = rfft(rng.standard_normal((len(smooth), on.samples)))
        series.append(irfft(white * np.sqrt(smooth), on.samples)[:, :length] * there[:, None])
    return pooled_power(series, on)
