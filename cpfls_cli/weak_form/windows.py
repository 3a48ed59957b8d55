"""Weak form: averages over smooth windows, with derivatives moved onto the window by integration by parts."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Protocol, Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cpfls_cli.arrays import Array, IntArray, Numbers
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError

FEWEST_SAMPLES = 8  # Of a window: fewer do not follow its curve.
FEWEST_WINDOWS = 16  # Windows below which a flight is too short.
_SAME_RATE = 1e-3  # Relative difference of sampling periods that clocks of one logger have, and that no floor shows.
_WHOLE = (slice(None),)


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows ``phi(s) = sin(pi s)^4``, scaled to integral 1 and repeated at a hop."""

    weight: Array  # Shape (window,): phi dt.
    slope: Array  # Shape (window,), 1/s: phi' dt.
    hop: int  # Samples from one window to the next.
    period: float  # Sampling period, s.

    def count(self, samples: int) -> int:
        """Count the windows that fit into a flight."""
        return max(0, (samples - len(self.weight)) // self.hop + 1)

    def centres(self, time: Array) -> Array:
        """Compute the middle of each window, shape (window,), s, of a flight by its time, shape (time,), s."""
        first = time[0] + 0.5 * (len(self.weight) - 1) * self.period
        return np.asarray(first + np.arange(self.count(len(time))) * self.hop * self.period)

    def average(self, values: Array, stretches: Iterable[slice] = _WHOLE) -> Array:
        """Average values, shape (time, ...), over windows of each stretch, ``int phi x dt``, shape (window, ...)."""
        return self._over(values, self.weight, stretches)

    def derivative(self, values: Array, stretches: Iterable[slice] = _WHOLE) -> Array:
        """Average the time derivative as `average` does, ``-int phi' x dt``; nothing is differentiated."""
        return -self._over(values, self.slope, stretches)

    def balance(self, direct: Array, momentum: Array | None = None, stretches: Sequence[slice] = _WHOLE) -> Array:
        """Average ``direct + d/dt momentum``, shapes (time, ...), as `average` does, shape (window, ...)."""
        averaged = self.average(direct, stretches)
        return averaged if momentum is None else averaged + self.derivative(momentum, stretches)

    def _over(self, values: Array, kernel: Numbers, stretches: Iterable[slice]) -> Array:
        if stretches is _WHOLE:
            return np.asarray(self.laid(values, kernel))
        return np.concatenate([self.laid(values[part], kernel) for part in (slice(0), *stretches)])

    def middles(self, stretches: Iterable[slice]) -> IntArray:
        """Give the sample in the middle of each window of these stretches, shape (window,)."""
        half = len(self.weight) // 2
        counts = ((part.start + half, self.count(part.stop - part.start)) for part in stretches)
        return np.concatenate([first + self.hop * np.arange(count) for first, count in counts])

    def modulated(self, frequency: float | Array) -> Self:
        """Shift windows to a frequency, Hz: ``phi(t) exp(-2 pi i f t)``, complex.

        Of several frequencies weight and slope have shape (sample, frequency).
        """
        turn = 2j * np.pi * np.asarray(frequency)
        phase = np.exp(-self.period * np.multiply.outer(turn, np.arange(len(self.weight))))
        slope = self.slope - np.multiply.outer(turn, self.weight)
        return replace(self, weight=(self.weight * phase).T, slope=(slope * phase).T)

    def alternating(self) -> Self:
        """Turn the sign of every other sample: white noise stays as large as it was, and what is smooth vanishes."""
        sign = 1.0 - 2.0 * (np.arange(len(self.weight)) % 2)
        return replace(self, weight=sign * self.weight, slope=sign * self.slope)

    def less(self, longer: Self) -> Self:
        """Take what windows twice as long or longer see, with the same middle, from what these see: a band is left."""
        weight, slope = -longer.weight, -longer.slope
        first = (len(weight) - len(self.weight)) // 2
        inside = slice(first, first + len(self.weight))
        weight[inside] += self.weight
        slope[inside] += self.slope
        return replace(self, weight=weight, slope=slope)

    def laid(self, values: Array, kernel: Numbers) -> Any:
        """Lay a kernel of the windows' length, or several, over values, shape (window, ..., kernel)."""
        if len(values) < len(kernel):
            return np.zeros((0, *values.shape[1:], *kernel.shape[1:]))
        views = sliding_window_view(values, len(kernel), axis=0)[:: self.hop]
        return views @ kernel


@lru_cache(maxsize=64)
def windows(period: float, window_s: float, overlap: float) -> Windows:
    """Make windows of a length for a sampling period.

    `period`: s.
    `window_s`: length, s.
    `overlap`: share that neighbours have in common.
    Raises InputError if a window holds too few samples.
    Reference: Weak form of differential equations: Shinbrot 1957 (modulating functions); Messenger and Bortz 2021.
    """
    samples = round(window_s / period)
    if samples < FEWEST_SAMPLES:
        raise InputError(
            f"gap.window_s = {window_s:g}: holds {samples} samples at {1 / period:.4g} Hz; at least {FEWEST_SAMPLES}"
        )
    phase = np.pi * (np.arange(samples) + 0.5) / samples
    shape = np.sin(phase) ** 4
    slope = np.sin(phase) ** 3 * np.cos(phase)
    # The derivative of time is 1, which eight samples of the window's own slope miss by 0.2 percent.
    slope /= -(slope @ np.arange(samples)) * period
    return Windows(shape / shape.sum(), slope, max(1, round(samples * (1 - overlap))), period)


class WindowSettings(Protocol):
    """Length of windows in s, and the share that neighbours have in common."""

    @property
    def window_s(self) -> float:
        """Length, s."""

    @property
    def overlap(self) -> float:
        """Share that neighbours have in common."""


def fitting_windows(period: float, settings: WindowSettings) -> Windows:
    """Make windows as long as asked for, or as long as a slow log needs."""
    return windows(period, max(settings.window_s, FEWEST_SAMPLES * period), settings.overlap)


def common_windows(flights: Sequence[Signals], settings: WindowSettings) -> Windows:
    """Make the windows that all flights share.

    Raises InputError if a flight is too short or has another sampling period than the first.
    """
    period = flights[0].period
    for flight in flights:
        other = flight.period
        if abs(other - period) > _SAME_RATE * period:
            raise InputError(
                f"{flight.name}: sampled at {1 / other:.6g} Hz, {flights[0].name} at {1 / period:.6g} Hz; set "
                "import.rate_hz to one rate for all flights"
            )
    shortest = min(flights, key=len)
    span_s = max(flight.rotor_span_s for flight in flights)
    window_s = max(settings.window_s, FEWEST_SAMPLES * span_s)
    length = f"gap.window_s = {window_s:g}"
    if window_s > settings.window_s:
        length = f"{window_s:.3g} s, {FEWEST_SAMPLES} updates of rotors that are logged every {span_s:.2g} s"
    if window_s > len(shortest) * period:
        raise InputError(f"{length}: longer than {shortest.name}, {len(shortest) * period:.3g} s")
    shared = windows(period, window_s, settings.overlap)
    for flight in flights:
        if shared.count(len(flight)) < FEWEST_WINDOWS:
            raise InputError(
                f"{flight.name}: {len(flight) * period:.3g} s are too short; {FEWEST_WINDOWS} windows of {length} are"
                " needed"
            )
    return shared
