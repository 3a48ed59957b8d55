"""The noise of a gyroscope in flight: its spectrum, lines in it for notches, and what it makes the motors do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.law import Law, chain
from cpfls_cli.result import about, result

_WINDOW_S = 1.0
LEAST = 256
"""Samples in a window, and of a log."""
_FLOOR_SHARE = 0.25
"""Floor at a frequency: the median over so much of it on either side."""
_LINE_DB, _LOWEST_LINE_HZ, _FROM_THE_END = 10.0, 25.0, 0.95
_MOST_LINES = 2
_LEFT = 1e-3
"""Part of the power that a filter leaves, below which what is behind it does not show what was in front."""


@result
class Line:
    """A line of a spectrum."""

    hz: float = about("its frequency", unit="Hz")
    width_hz: float = about("its width", unit="Hz")
    above_db: float = about("over the floor around it", unit="dB")


@result
class Noise:
    """Spectrum of body rates, single-sided, mean over flights."""

    SHOWN = ("lines",)

    frequency: Array = about("as far as the logs show", "noise frequency", unit="Hz", brief=False)
    density: Array = about("of body rates", "noise frequency", "axis", unit="rad^2/s^2/Hz", frame="body", brief=False)

    @property
    def highest_hz(self) -> float:
        """Highest frequency that the flights show; what is above is folded below it, if the log has no filter."""
        return float(self.frequency[-1])

    def of_command(self, law: Law, axis: int) -> float:
        """Compute how much it makes the command about an axis jitter, root mean square.

        In shares of the full command, from 10 Hz on and as far as the flights show, without the answer of the vehicle.
        """
        shown = (self.frequency >= 10.0) & (self.frequency < 0.49 * law.rate_hz)
        gain = np.abs(law.response(axis, self.frequency[shown]).feedback)
        spacing = float(self.frequency[1] - self.frequency[0])
        return float(np.sqrt((gain**2 * self.density[shown, axis]).sum() * spacing))

    def before_filters(self, law: Law) -> Noise:
        """Give the noise in front of the law's filters of the gyroscope, from what was logged behind them."""
        back = np.exp(-2j * np.pi * self.frequency * law.period)
        left = np.stack([np.abs(chain(axis.measured, back, law.period)) ** 2 for axis in law.axes], axis=1)
        return replace(self, density=self.density / np.maximum(left, _LEFT))

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        """Lines of 10 dB and more over the floor, the strongest first."""
        total = self.density.sum(axis=1)
        floor = np.array([np.median(total[self._near(hz)]) for hz in self.frequency])
        above = 10 * np.log10(np.maximum(total, 1e-30) / np.maximum(floor, 1e-30))
        inside = (self.frequency > _LOWEST_LINE_HZ) & (self.frequency < _FROM_THE_END * self.highest_hz)
        peaks = np.flatnonzero(inside[1:-1] & (above[1:-1] >= np.maximum(above[:-2], above[2:]))) + 1
        found: list[Line] = []
        for peak in sorted(peaks, key=lambda each: -total[each]):
            hz = float(self.frequency[peak])
            apart = all(abs(hz - each.hz) > max(each.width_hz, hz / 5) for each in found)
            if above[peak] >= _LINE_DB and apart and len(found) < _MOST_LINES:
                found.append(Line(hz=hz, width_hz=self._width(above, int(peak)), above_db=float(above[peak])))
        return tuple(found)

    def _near(self, hz: float) -> Array:
        return np.asarray(np.abs(self.frequency - hz) <= max(_FLOOR_SHARE * hz, 5.0))

    def _width(self, above: Array, peak: int) -> float:
        """Give the width of a line where it is half its decibels above the floor, at least a tenth of it, Hz."""
        half = 0.5 * above[peak]
        left = peak - int(np.argmax(above[peak::-1] < half))
        right = peak + int(np.argmax(above[peak:] < half))
        return max(float(self.frequency[right] - self.frequency[left]), 0.1 * float(self.frequency[peak]))


def noise_of(flights: Sequence[tuple[Array, Array]]) -> Noise | None:
    """Estimate the spectrum of body rates by windows of a second; None where no flight is long enough.

    Parameters
    ----------
    flights : sequence of (array, array)
        Times, shape (time,), s, and body rates, shape (time, 3), rad/s, which may lack samples.
    """
    steps = [float(np.median(np.diff(time))) for time, _ in flights if len(time) > LEAST]
    rates = [1 / step for step in steps if step > 0]
    if not rates:
        return None
    slowest = min(rates)
    count = max(round(_WINDOW_S * slowest), LEAST)
    window = np.hanning(count)[:, None]
    scale = 2 / (slowest * float((window**2).sum()))
    spectra = []
    for time, rate in (part for flight in flights for part in _between_pauses(*flight)):
        even = np.arange(time[0], time[-1], 1 / slowest)
        values = np.stack([np.interp(even, time, column) for column in rate.T], axis=1)
        for begin in range(0, len(even) - count + 1, count // 2):
            part = values[begin : begin + count]
            spectra.append(scale * np.abs(np.fft.rfft(window * (part - part.mean(axis=0)), axis=0)) ** 2)
    if not spectra:
        return None
    frequency = np.fft.rfftfreq(count, 1 / slowest)
    return Noise(frequency=np.asarray(frequency[1:], dtype=float), density=np.mean(spectra, axis=0)[1:])


def _between_pauses(time: Array, rate: Array) -> Iterator[tuple[Array, Array]]:
    """Cut a log where it pauses longer than a window; a line over the pause would be a rate without noise."""
    pauses = np.flatnonzero(np.diff(time) > _WINDOW_S) + 1
    for part in zip(np.split(time, pauses), np.split(rate, pauses), strict=True):
        if len(part[0]) > LEAST:
            yield part
