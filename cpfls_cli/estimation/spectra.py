"""Spectra of tapered windows, pooled by block: what estimates by frequency are made of; Whittle's likelihood."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import fft
from scipy.ndimage import uniform_filter1d

from cpfls_cli.arrays import Array, BoolArray, IntArray, Numbers
from cpfls_cli.blocks import MOST_BLOCKS

_STEPS = 500
"""Of the search."""

Spectrum = Callable[[Array], tuple[Array, Callable[[Array], Array]]]
"""From numbers to the expected power, shape (piece, frequency) or (frequency,), and to a function that turns slopes by
that, shape (piece, frequency), into slopes by the numbers."""


class GaussMarkov(NamedTuple):
    """Power that a Gauss-Markov process of unit size has in windows, by its memory.

    Attributes
    ----------
    alike : array, shape (frequency, lag)
        Power by frequency that unit correlation at a lag has.
    lags : array, shape (lag,), s
    """

    alike: Array
    lags: Array

    @classmethod
    def seen_by(cls, weight: Array, period: float, turns: Array) -> GaussMarkov:
        """Take windows of a weight, shape (sample,), at some frequencies, rad/s."""
        lags = np.asarray(period * np.arange(len(weight)), dtype=float)
        alike = np.correlate(weight, weight, "full")[len(weight) - 1 :]
        return cls(np.cos(np.outer(turns, lags)) * alike * np.where(lags == 0, 1.0, 2.0), lags)

    def power(self, memory: float) -> tuple[Array, Array]:
        """Give the power by frequency, and its derivative by the logarithm of the memory, shapes (frequency,)."""
        ages = self.lags / memory
        falls = np.exp(-ages)
        return self.alike @ falls, self.alike @ (falls * ages)


def most_likely(
    spectrum: Spectrum, power: Array, starts: Sequence[Array], bounds: Sequence[tuple[float, float]]
) -> Array:
    """Find the numbers of a spectrum that make the power of pieces most likely.

    Parameters
    ----------
    power : array, shape (piece, frequency)
    starts : sequence of array, shape (number,)
        The best of all ends counts.

    References
    ----------
    Whittle 1953, Estimation and information in stationary time series.
    """
    from scipy.optimize import minimize

    def unlikely(numbers: Array) -> tuple[float, Array]:
        expected, slopes_by = spectrum(numbers)
        ratio = power / expected
        worse = float((ratio + np.log(expected)).sum()) / len(power)
        return worse, slopes_by((1.0 - ratio) / expected) / len(power)

    found = (
        minimize(unlikely, own, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": _STEPS})
        for own in starts
    )
    return np.asarray(min(found, key=lambda each: float(each.fun)).x)


_FEWEST_IN_BLOCK = 3
"""Windows of a block: those of its ends share samples with the neighbours."""
FEWEST_BLOCKS = 6
"""Below which there is no estimate by frequency."""
SHARED_BINS = 1.5
"""Neighbouring frequencies of Hann's window for one independent."""
SMOOTHED_BINS = 5
"""Over which spectra are averaged where they are smooth."""
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class BlockSpectra:
    """Sums over windows of products of Fourier transforms.

    Attributes
    ----------
    frequency : array, shape (frequency,), Hz
    cross : array of complex, shape (block, frequency, signal, signal)
        ``conj(first) second``, summed over the windows of a block.
    windows : array of int, shape (block,)
    """

    frequency: Array
    cross: Numbers
    windows: IntArray

    @cached_property
    def total(self) -> Numbers:
        """Sum over blocks, shape (frequency, signal, signal)."""
        return np.asarray(self.cross.sum(axis=0))

    def coherence(self, first: int, second: int) -> Array:
        """Give the share of one signal that another explains, less what chance explains, shape (frequency,)."""
        total, windows = self.total, max(int(self.windows.sum()), 2)
        power = np.maximum((total[:, first, first] * total[:, second, second]).real, _TINY)
        return coherence(total[:, first, second], power, windows)

    def gain(self, instrument: int, first: int, second: int) -> Numbers:
        """Estimate second over first by an instrument, shape (frequency,); by least squares if it is the first."""
        below = self.total[:, instrument, first]
        return np.asarray(self.total[:, instrument, second] / np.where(below == 0, _TINY, below))


def coherence(cross: Numbers, power: Array, windows: Array | float) -> Array:
    """Compute the share that one signal explains of another, less what chance explains with so few windows.

    Parameters
    ----------
    power : array, shape (frequency,)
        Product of both.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        raw = np.abs(cross) ** 2 / power
        found = 1 - (1 - raw) * windows / (windows - 1)
    return np.asarray(np.clip(np.where(np.asarray(windows) > 1, found, 0.0), 0.0, 1.0))


def smoothed(values: Numbers, width: int = SMOOTHED_BINS, axis: int = -1) -> Numbers:
    """Average neighbouring frequencies, along an axis, fewer at the ends."""
    count = values.shape[axis]
    near = np.abs(np.subtract.outer(np.arange(count), np.arange(count))) <= width // 2
    mean = near / near.sum(axis=1, keepdims=True)
    return np.asarray(np.moveaxis(np.tensordot(mean, values, (1, axis)), 0, axis))


def window_starts(usable: BoolArray, length: int) -> IntArray:
    """Give where windows begin that overlap by half and lie wholly in usable samples."""
    begins: list[IntArray] = []
    edges = np.flatnonzero(np.diff(np.concatenate([[0], usable.astype(np.int8), [0]])))
    for first, after in edges.reshape(-1, 2):
        begins.append(np.arange(first, after - length + 1, max(length // 2, 1), dtype=np.int64))
    return np.concatenate(begins) if begins else np.zeros(0, dtype=np.int64)


def without_slow(values: Array, usable: BoolArray, half: int) -> Array:
    """Take off the mean under a triangle of so many samples to either side.

    Slow motion is the largest, and would leak into windows of faster.
    """
    filled = np.where(usable, values, 0.0)
    return np.asarray(filled - uniform_filter1d(uniform_filter1d(filled, half, mode="nearest"), half, mode="nearest"))


def eroded(usable: BoolArray, half: int) -> BoolArray:
    """Tell where so many samples to either side are usable too."""
    count = np.concatenate([np.zeros(half + 1), np.cumsum(usable), np.full(half, usable.sum())])
    return np.asarray(usable & (count[2 * half + 1 :] - count[: -2 * half - 1] > 2 * half))


def transforms(signal: Array, begins: IntArray, length: int, period: float, derivatives: int = 0) -> list[Numbers]:
    """Transform windows of a signal and of its derivatives under Hann's taper, shape (window, frequency) each.

    Derivatives are moved onto the taper by parts, ``int w x' e = -int (w e)' x``: a pole is exact then, and nothing is
    differentiated.
    """
    frames, phase = signal[begins[:, None] + np.arange(length)], 2 * np.pi * (np.arange(length) + 0.5) / length
    turn, ripple = 2j * np.pi * fft.rfftfreq(length, period), np.pi / (length * period)
    found = [fft.rfft(frames * (0.5 - 0.5 * np.cos(phase)), axis=1)]
    if derivatives:
        bent = fft.rfft(frames * (ripple * np.sin(phase)), axis=1)
        found.append(turn * found[0] - bent)
    if derivatives > 1:
        curved = fft.rfft(frames * (2 * ripple**2 * np.cos(phase)), axis=1)
        found.append(curved - 2 * turn * bent + turn**2 * found[0])
    return found


def cut_blocks(information: Array) -> IntArray:
    """Cut a row of windows into blocks of about equal information, the number of the block of each.

    Parameters
    ----------
    information : array, shape (window,)
        At least 0, such as the power of the instrument: bursts are cut finer than rest.
    """
    count = max(min(MOST_BLOCKS, len(information) // _FEWEST_IN_BLOCK), 1)
    share = information.sum() / count
    block, number, inside, gathered = np.zeros(len(information), dtype=np.int64), 0, 0, 0.0
    for window, value in enumerate(information):
        if inside >= _FEWEST_IN_BLOCK and gathered >= share * (1 - 1e-9):
            number, inside, gathered = number + 1, 0, 0.0
        block[window] = number
        inside, gathered = inside + 1, gathered + float(value)
    # A rest at the end is too little for a block of its own.
    if number and (inside < _FEWEST_IN_BLOCK or gathered < 0.5 * share):
        block[block == number] = number - 1
    return block


def block_spectra(parts: list[Numbers], block: IntArray, frequency: Array, inside: BoolArray) -> BlockSpectra:
    """Sum products of transforms by block, at some frequencies.

    Parameters
    ----------
    parts : list of array, shape (window, frequency)
        Of each signal.
    inside : array of bool, shape (frequency,)
    """
    stacked = np.stack([each[:, inside] for each in parts], axis=2)
    blocks = int(block.max()) + 1 if len(block) else 0
    cross = np.array(
        [np.einsum("wfi,wfj->fij", stacked[block == b].conj(), stacked[block == b]) for b in range(blocks)]
    )
    return BlockSpectra(frequency[inside], cross, np.bincount(block, minlength=blocks).astype(np.int64))
