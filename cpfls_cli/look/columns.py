"""Columns of a log as `look` takes them: on their own clocks, in SI and in axes forward, right, down."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.names import is_of
from cpfls_cli.flightlog.recognised import LogTable
from cpfls_cli.flightlog.smoothing import low_pass
from cpfls_cli.flightlog.topics import STAMP, Topics
from cpfls_cli.flightlog.vocabulary import CRAZYFLIE, KNOWN
from cpfls_cli.look.flight import Samples
from cpfls_cli.units import known_unit

FRD: Final = np.array([1.0, -1.0, -1.0])
"""Signs that make axes forward, right, down of forward, left, up, and the other way round."""

_AHEAD_S: Final = 0.1
"""By which a sample is taken before the message that holds it is stamped, at most."""

_THINNED, _PASSED = 1.5, 0.4
"""Times as fast as a clock from which on a signal is filtered before it is put on it, and up to which share of the
clock's rate it passes."""

_SLOW_HZ: Final = 5.0
"""Below which two sensors of one motion, and what follows it, are compared."""

_BRIDGED_STEPS, _BRIDGED_S = 5.0, 0.25
"""Steps of a signal, and s, up to which it is known between two samples."""


class LookedLog:
    """A log by columns, times of samples in s from its first stamp."""

    def __init__(self, topics: Topics, units: Mapping[str, str], system: str) -> None:
        self.table = LogTable({name: _stamped_as_sampled(fields) for name, fields in topics.items()}, units)
        self.system, self.names = system, frozenset(self.table.names)

    def samples(self, columns: Sequence[str]) -> Samples | None:
        """Give columns as they were logged; None where one is absent, or fewer than two rows hold a value."""
        if not self.names.issuperset(columns):
            return None
        time, values = self.table.values(columns)
        return Samples(time - self.table.origin, values, in_words(columns)) if len(time) > 1 else None

    def found(self, *signals: str) -> Iterator[Samples]:
        """Give what the rows of `KNOWN` name, in SI and in axes forward, right, down, the first row first."""
        # On its card a Crazyflie puts the name of an event before that of a variable.
        events = ("", *(f"{topic}." for topic in self.table.topics if self.system.startswith(CRAZYFLIE)))
        for row in KNOWN:
            if row.signal in signals and self._writes(row.system):
                named = (self.samples([event + column for column in row.columns]) for event in events)
                for samples in filter(None, named):
                    factor = row.scale * (known_unit(row.unit).factor if row.unit else 1.0)
                    signs = np.array(row.sign or (1.0,)) * (FRD if row.frame == "FLU" else 1.0)
                    yield samples._replace(values=factor * signs * samples.values)

    def _writes(self, system: str) -> bool:
        """Tell whether one kind of log wrote this, by its own names where nothing says so: plain words say no unit."""
        if self.system:
            return is_of(self.system, system)
        names = (name for row in KNOWN if row.system == system for name in row.columns)
        own = tuple(name.partition("*")[0] for name in names if {".", "["} & set(name))
        return bool(own) and any(name.startswith(own) for name in self.names)


def in_words(columns: Sequence[str]) -> str:
    """Name columns: the topic once, where they are of one."""
    topic, dot, _ = columns[0].partition(".")
    same = dot and all(name.startswith(f"{topic}.") for name in columns)
    return f"{topic}.{', '.join(name.partition('.')[2] for name in columns)}" if same else ", ".join(columns)


def _stamped_as_sampled(fields: Mapping[str, Array]) -> Mapping[str, Array]:
    """Stamp the rows of a topic with when their sample was taken, where it says so."""
    taken, stamp = fields.get(f"{STAMP}_sample"), fields.get(STAMP)
    if taken is None or stamp is None or len(taken) != len(stamp) or not len(stamp):
        return fields
    ahead = np.asarray(stamp - taken, dtype=float)
    return {**fields, STAMP: taken} if bool(((ahead >= 0) & (ahead < _AHEAD_S)).all()) else fields


def on_clock(samples: Samples | None, clock: Array, channels: int, *, cubic: bool = False) -> Array:
    """Put a signal on a uniform clock, shape (time, channel): linear between samples, NaN where there are none.

    What comes faster than the clock is filtered first, without shift of phase, so that no vibration is folded into the
    band of the clock. `cubic`: by cubic splines where every sample is known; lines weaken what moves at a tenth of the
    samples' rate by 3 %.
    """
    if samples is None:
        return np.full((len(clock), channels), np.nan)
    time, values = samples.time, samples.values.reshape(len(samples.time), -1)
    step, rate_hz = float(np.median(np.diff(time))), 1 / float(clock[1] - clock[0])
    if samples.rate_hz > _THINNED * rate_hz:
        values = low_pass(values, samples.rate_hz, _PASSED * rate_hz, 4)
    if cubic and len(time) > 1 and np.isfinite(values).all():
        from scipy.interpolate import CubicSpline

        own = CubicSpline(time, values)(clock)
        own[(clock < time[0]) | (clock > time[-1])] = np.nan
    else:
        own = np.column_stack([np.interp(clock, time, channel, left=np.nan, right=np.nan) for channel in values.T])
    after = np.clip(np.searchsorted(time, clock), 1, len(time) - 1)
    own[(time[after] - time[after - 1]) > max(_BRIDGED_STEPS * step, _BRIDGED_S)] = np.nan
    return own


def compared(one: Samples, other: Samples) -> tuple[Array, Array]:
    """Give slow parts of two signals on one clock, shape (time, channel), their means left out."""
    hz = min(4 * _SLOW_HZ, one.rate_hz, other.rate_hz)
    begin, end = max(one.time[0], other.time[0]), min(one.time[-1], other.time[-1])
    clock = np.arange(begin, max(end, begin + 3 / hz), 1 / hz)
    pair = [on_clock(own, clock, own.values.shape[1]) for own in (one, other)]
    known = np.isfinite(np.hstack(pair)).all(axis=1)
    first, second = (own[known] - own[known].mean(axis=0) for own in pair)
    return first, second


def along_each(one: Samples, other: Samples) -> tuple[Array, Array]:
    """Correlate two signals, and give the factor that makes the second of the first, each axis by itself."""
    first, second = compared(one, other)
    own, crossed, others = ((a * b).sum(axis=0) for a, b in ((first, first), (first, second), (second, second)))
    still = (own <= 0) | (others <= 0)
    size = np.where(still, 1.0, np.sqrt(own * others))
    return np.where(still, 0.0, crossed / size), np.where(still, 0.0, crossed / np.where(own > 0, own, 1.0))
