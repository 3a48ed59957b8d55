"""What was before as an instrument: it tells the vehicle from its loop where nothing comes again and nothing was asked.

What lasts of a gust, as long as its memory is, shows in what is left of a balance; what is new in it nobody knew
before, nor any loop.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.estimation.first_stage import OF_MANY, first_stage_fit_by_run
from cpfls_cli.playback.balances import (
    OVERLAP,
    Balances,
    ByBand,
    Laid,
    Rows,
    Signals,
    averaged,
    band_windows,
    middles_of,
)
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES, Windows

_WINDOW_S, _SLOW_S = 0.08, 0.25
"""Windows, as short as samples allow: nothing within one is known when it begins. What was foretold is averaged over
the second, which leaves what is slow of it: most effects that a model lacks are in it."""
_PARTED_HZ = 2.0
"""Above what was foretold is fast, about."""
_PER_WINDOW = round(1 / (1 - OVERLAP))
LATER = 0.25
"""What is new comes so much later, share of a window."""
_BEFORE = range(2 * _PER_WINDOW, 4 * _PER_WINDOW, _PER_WINDOW // 2)
"""What was before ended a whole window before another begins: gusts that remember in more ways than one forget all but
one of them, and logs that were filtered forward and backward what they know of what comes."""


class News(NamedTuple):
    """What comes newly after windows of runs.

    Attributes
    ----------
    rows, foretold : list of array, shape (window, axis, column)
        What is new, and what of that was foretold; of each run the last windows.
    lasts : array, shape (axis, 1)
        Share of what is left that lasts until then.
    """

    rows: list[Array]
    foretold: list[Array]
    lasts: Array


def what_is_new(
    rows: Sequence[Array],
    left: Sequence[Array],
    told: Sequence[Array],
    ahead: int,
    before: Sequence[int],
    *,
    many: bool = False,
) -> News:
    """Give what comes newly after each window, and what windows that ended before it tell of that.

    With r what is left, a moment later and now, and a the share of it that lasts so long, ``r' - a r`` has of a gust
    only what has come since the window began. Whatever ended before that knows nothing of it, the loop's answers to
    older gusts and noise included. a is seen in what is left, by what it was before.

    Parameters
    ----------
    rows : sequence of array, shape (window, axis, column)
        Of each run, linear in what acts.
    left : sequence of array, shape (window, axis)
        What is left of the balances.
    told : sequence of array, shape (window, signal) or (window, axis, signal)
        What is known of each window when it has ended; of each axis by itself, where all are foretold alike.
    ahead : int
        By how many windows later is later.
    before : sequence of int
        How many windows ago what is known ended, the longest last; the first of them no longer overlap.
    many : bool
        Whether many signals are known that go together.

    References
    ----------
    Holtz-Eakin, Newey and Rosen 1988 (quasi-differences, with the past as instrument); Söderström and Stoica 2002.
    """
    first = before[-1]

    def later(values: Sequence[Array], by: int) -> list[Array]:
        return [own[first + by :][: max(0, len(own) - first - ahead)] for own in values]

    # What a run is off by throughout is no gust.
    off = [own - own.mean(axis=0) if len(own) else own for own in left]
    was = [np.sum(each, axis=0) for each in zip(*(later(off, -lag) for lag in before), strict=True)]
    # By what was before both, which the noise of neither has a part in.
    kept, now = (
        sum((each * own).sum(axis=0) for each, own in zip(later(off, by), was, strict=True)) for by in (ahead, 0)
    )
    lasts = np.clip(kept / np.where(now > 0, now, np.inf), 0.0, 1.0)[:, None]
    new = [then - lasts * own for then, own in zip(later(rows, ahead), later(rows, 0), strict=True)]
    past = [np.concatenate(each, axis=-1) for each in zip(*(later(told, -lag) for lag in before), strict=True)]
    flat = {number: own.reshape(-1, own.shape[-1]) for number, own in enumerate(past) if len(own)}
    values = {number: new[number].reshape(len(own), -1) for number, own in flat.items()}
    known = first_stage_fit_by_run(flat, values, *([OF_MANY] if many else []))
    foretold = [known[number].reshape(own.shape) if number in known else own for number, own in enumerate(new)]
    return News(new, foretold, lasts)


class PastBalances(Balances):
    """Balances of what is new along flights, and what of them was foretold by what was before."""

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

    def products(self, bands: Sequence[Windows], signals: Mapping[int, Signals], laid: Laid) -> ByBand:
        """Sum products of what is new with what of it was foretold fast, and slowly."""
        band = bands[0]
        rows = list(self._new(band, signals, laid))
        count = max(1, round(_SLOW_S / (band.hop * band.period)))
        slow = [_mean_of_last(own.known, count) for own in rows]
        fast = [own._replace(known=own.known - mean) for own, mean in zip(rows, slow, strict=True)]
        return [
            self.of_band(fast),
            self.of_band(own._replace(known=mean) for own, mean in zip(rows, slow, strict=True)),
        ]

    def _new(self, band: Windows, signals: Mapping[int, Signals], laid: Laid) -> Iterator[Rows]:
        parts = [
            (number, replace(self.flights[number], stretches=(part,)))
            for number in self.path
            for part in self.flights[number].stretches
        ]
        rows = [laid(band, flight, signals[number]) for number, flight in parts]
        left = [np.einsum("wac,ac->wa", own, laid.left) for own in rows]
        told = [averaged(band, flight, _seen(flight)) for _, flight in parts]
        new, known, _ = what_is_new(rows, left, told, round(LATER * _PER_WINDOW), _BEFORE)
        for (number, flight), own, foretold in zip(parts, new, known, strict=True):
            middles = middles_of(band, flight)
            yield Rows(number, own, foretold, middles[len(middles) - len(own) :])


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
