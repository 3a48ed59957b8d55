"""The past as an instrument: it separates the vehicle from its loop where nothing is repeatable and nothing was asked.

What lasts of a gust, as long as its memory is, shows in the residual of a balance; its innovations nobody knew before,
nor any loop.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.playback.balances import (
    OVERLAP,
    Balances,
    ByBand,
    Rows,
    Signals,
    WindowedColumns,
    averaged,
    band_windows,
    middles_of,
)
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.innovations import innovations
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES, Windows

_WINDOW_S, _SLOW_S = 0.08, 0.25
"""Windows, as short as samples allow: nothing within one is known when it begins. Predictions are averaged over the
second, which leaves what is slow of them: most effects that a model lacks are in it."""
_PARTED_HZ = 2.0
"""Above predictions are fast, about."""
_PER_WINDOW = round(1 / (1 - OVERLAP))
_BEFORE = range(2 * _PER_WINDOW, 4 * _PER_WINDOW, _PER_WINDOW // 2)
"""What was before ended a whole window before another begins: gusts that remember in more ways than one forget all but
one of them, and logs that were filtered forward and backward what they know of what comes."""


class PastBalances(Balances):
    """Balances of innovations along flights, and what the past predicts of them."""

    of_past: ClassVar[bool] = True

    @cached_property
    def bands_hz(self) -> tuple[tuple[float, float], ...]:
        """Bands of torque by frequency, about."""
        (band, *_) = self.bands
        return (_PARTED_HZ, 1 / (len(band.weight) * band.period)), (0.0, _PARTED_HZ)

    @cached_property
    def bands(self) -> tuple[Windows, ...]:
        """Windows of torque, then of force; in all bands the same."""
        period = self.flights[0].motion.period
        one = band_windows(period, max(_WINDOW_S, FEWEST_SAMPLES * period), None)
        return (one, one) * (2 if self.translates else 1)

    @cached_property
    def path(self) -> dict[int, tuple[int, Array]]:
        """Each flight is a path of its own."""
        return {number: (number, np.arange(len(flight), dtype=float)) for number, flight in enumerate(self.flights)}

    def products(self, bands: Sequence[Windows], signals: Mapping[int, Signals], windowed: WindowedColumns) -> ByBand:
        """Sum products of innovations with their predictions, fast ones and slow ones."""
        band = bands[0]
        rows = list(self._new(band, signals, windowed))
        count = max(1, round(_SLOW_S / (band.hop * band.period)))
        slow = [_mean_of_last(own.known, count) for own in rows]
        fast = [own._replace(known=own.known - mean) for own, mean in zip(rows, slow, strict=True)]
        return [
            self.of_band(fast),
            self.of_band(own._replace(known=mean) for own, mean in zip(rows, slow, strict=True)),
        ]

    def _new(self, band: Windows, signals: Mapping[int, Signals], windowed: WindowedColumns) -> Iterator[Rows]:
        parts = [
            (number, replace(self.flights[number], stretches=(part,)))
            for number in self.path
            for part in self.flights[number].stretches
        ]
        rows = [windowed(band, flight, signals[number]) for number, flight in parts]
        residual = [np.einsum("wac,ac->wa", own, windowed.residual) for own in rows]
        seen = [averaged(band, flight, _seen(flight)) for _, flight in parts]
        new, known, _ = innovations(rows, residual, seen, _PER_WINDOW, _BEFORE)
        for (number, flight), own, predicted in zip(parts, new, known, strict=True):
            middles = middles_of(band, flight)
            yield Rows(number, own, predicted, middles[len(middles) - len(own) :])


def _seen(flight: PlaybackFlight) -> Array:
    """Give what is measured and moves with torque and force, shape (time, signal)."""
    columns = [flight.motion.rate, flight.speed**2]
    return np.hstack([*columns, flight.motion.velocity] if flight.translates else columns)


def _mean_of_last(values: Array, count: int) -> Array:
    """Average over so many last windows, of the first over as many as there are, shape (window, ...)."""
    sums = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    last = np.arange(1, len(values) + 1)
    first = np.maximum(last - count, 0)
    return np.asarray((sums[last] - sums[first]) / (last - first)[:, None, None])
