"""How fast a signal of a log really is: updates that come slower than the clock, and a filter before the log."""

from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.flightlog.repair import SignalTable
from cpfls_cli.flightlog.settings import COMMANDS, ImportSettings

# A coarse voltage hardly changes, and nothing is derived from it.
_NOT_JUDGED = frozenset({"voltage"})
# A rigid body hardly answers what is faster than half of this, and no controller holds a command for longer.
_FAST_HZ = 100.0
_ON_RATE = 0.95  # Clocks of loggers are off, and stamps are rounded.
_FEWEST_UPDATES = 20  # Below which a regular step may be chance.
_REGULAR_SHARE = 0.8
_LARGEST_SHARE_AT_ONCE = 0.2  # Of updates that come from row to row: jitter, not a rate.
# A knot between two rows bends the line at both of them.
_ROWS_OF_KNOT = 2
_ROUNDING = 1e-6  # Of the largest step between updates.
_STAYED = 1.5  # Times the usual time between updates.
_STRAIGHT = 1e-3  # Bend of what is interpolated, by the rounding of a file, as a share of the largest.
# Measured: logs of five vehicles fall by 29 dB below their trend at most, those that were filtered forward and backward
# by 38 to 85 dB.
_CLIFF_DB = 30.0
_STEEPEST_BEFORE_DB = 24.0  # Fall in an octave up to which a trend is that of motion, a filter of fourth order.
# A line of vibration is above its trend; a filter leaves no band beyond it near any band before it.
_CLEARANCE_DB = 25.0
_LOWEST_HZ = 8.0
_HIGHEST_SHARE = 0.48  # Of the rate: above, aliasing shapes the spectrum.
_BANDS_PER_OCTAVE = 8
_FEWEST_BANDS = 5  # For the line of a trend.
_LEAST_OCTAVES_BEYOND = 0.3  # That have to be known for a fall to be a cliff.
_LONGEST_SEGMENT = 2048
_SEGMENTS = 4
_FEWEST_IN_SEGMENT = 64  # Lines of a spectrum, below which bands hold none.
_LINES_OF_WINDOW = 8  # Over which the Blackman-Harris window smears a line.
_HALVED_DB = 6.0
# The trend that the cut-off is read against, clear of the fall itself.
_TREND_OCTAVES, _CLEAR_OCTAVES = 2.0, 0.5
_SMALLEST_POWER = 1e-300


class SlowSignal(NamedTuple):
    """A signal that is updated slower than the clock of its log."""

    name: str
    rate_hz: float  # Of its updates.
    between: Literal["repeated", "interpolated"]  # What the rows between two updates hold.


def is_fast(rate_hz: float) -> bool:
    """Tell whether updates come so often that a command is held until the next, and shows what moves a body."""
    return rate_hz >= _ON_RATE * _FAST_HZ


def slow_signals(table: SignalTable, stamped_hz: Mapping[str, float] | None = None) -> tuple[SlowSignal, ...]:
    """Find signals of a table as logged whose updates come at less than half the rate of the rows.

    Between updates the rows repeat the last value, or lie on a straight line. What a coarse resolution repeats is
    none: its steps are irregular.

    Of those that were logged with stamps of their own, so often a second, the stamps decide, unless their values come
    slower still.
    """
    rate = 1 / float(np.median(np.diff(table.time))) if len(table.time) > 1 else 0.0
    found = {name: _slow(name, table.time, values) for name, values in table.signals.items() if name not in _NOT_JUDGED}
    for name, own in (stamped_hz or {}).items():
        if name in found and 0 < 2 * own <= rate:
            seen = found[name]
            if seen is None or seen.rate_hz > _REGULAR_SHARE * own:
                held = name in COMMANDS and is_fast(own)
                found[name] = SlowSignal(name, own, "repeated" if held else "interpolated")
    return tuple(signal for signal in found.values() if signal is not None)


def _slow(name: str, time: Array, values: Array) -> SlowSignal | None:
    known = np.isfinite(values).all(axis=1)
    time, values = time[known], values[known]
    if len(time) < _FEWEST_UPDATES:
        return None
    steps, step = np.diff(values, axis=0), float(np.median(np.diff(time)))
    updates = np.flatnonzero((steps != 0).any(axis=1))
    if _regular(updates, fewest=2):
        return SlowSignal(name, 1 / (step * _apart(updates)), "repeated")
    bends = np.abs(np.diff(steps / np.diff(time)[:, None], axis=0))
    straight = np.all(bends <= _STRAIGHT * np.quantile(bends, 0.95, axis=0), axis=1)
    knots = np.flatnonzero(~straight & np.concatenate([[True], straight[:-1]]))
    if _regular(knots, fewest=_ROWS_OF_KNOT + 1):
        usual = float(np.median(np.diff(knots)))
        if straight.mean() >= _REGULAR_SHARE * (usual - _ROWS_OF_KNOT) / usual:
            return SlowSignal(name, 1 / (step * _apart(knots)), "interpolated")
    return None


def _regular(updates: IntArray, fewest: int) -> bool:
    """Tell whether updates are some rows apart, and nearly always the same number of them."""
    if len(updates) < _FEWEST_UPDATES:
        return False
    apart = np.diff(updates)
    usual, near = float(np.median(apart)), _near(apart)
    return bool(usual >= fewest and near.mean() >= _REGULAR_SHARE and (apart < fewest).mean() <= _LARGEST_SHARE_AT_ONCE)


def _near(apart: IntArray) -> BoolArray:
    usual = float(np.median(apart))
    return np.asarray(np.abs(apart - usual) <= max(1.0, 0.25 * usual))


def _apart(updates: IntArray) -> float:
    """Give the rows from one update to the next, without pauses in which nothing changes, as of rotors that idle."""
    apart = np.diff(updates)
    return float(apart[_near(apart)].mean())


def between_updates(values: Array, apart: float) -> Array:
    """Put straight lines between updates that rows repeat, shape (row, column), `apart` rows from each to the next.

    What is repeated comes late by half the time between updates, and its steps fold into slow motion where a window
    moves on by about that time. An update that was put on another clock takes some rows, of which the last has it.
    What stays for longer than usual, as of rotors that idle, does so until the update before the one that changes it.
    What was low-passed has no updates left: the mean of what follows lies on the same lines, low-passed.
    """
    steps = np.abs(np.diff(values, axis=0))
    # On another clock that is off by rounding the second row changes by rounding.
    changed = (steps > _ROUNDING * steps.max(axis=0, initial=0.0)).any(axis=1)
    updates = np.flatnonzero(np.append(True, changed))
    first = np.append(True, np.diff(updates) > 1)
    last = np.append(first[1:], True)
    runs = np.bincount(np.cumsum(first) - 1)
    longest = max(_ROWS_OF_KNOT, 0.5 * apart)
    if np.median(runs) > longest:
        return _mean_ahead(values, apart)
    updates = updates[last | (np.repeat(runs, runs) > longest) & ~first]
    usual = round(apart)
    stayed = np.diff(updates) > _STAYED * usual
    knots = np.union1d(updates, updates[1:][stayed] - usual)
    return np.column_stack([np.interp(np.arange(len(values)), knots, own) for own in values[knots].T])


def _mean_ahead(values: Array, rows: float) -> Array:
    row = np.arange(len(values))
    padded = np.concatenate([np.zeros((1, values.shape[1])), values, np.repeat(values[-1:], int(rows) + 1, axis=0)])
    total = np.cumsum(padded, axis=0)
    ahead = [np.interp(row + rows, np.arange(len(total)), own) for own in total.T]
    return np.asarray((np.column_stack(ahead) - total[: len(values)]) / rows)


def warn_of_slow(slow: tuple[SlowSignal, ...], rate_hz: float) -> Iterator[str]:
    """Say of signals that are slower than the clock, and slower than 100 Hz, how slow they are and what that costs."""
    for signal in (own for own in slow if not is_fast(own.rate_hz)):
        between, cost = "lie on a straight line between two updates", "knows"
        if signal.between == "repeated":
            between, cost = "repeat the last value", f"is {500 / signal.rate_hz:.3g} ms late on average, and knows"
        yield (
            f"{signal.name} is updated {signal.rate_hz:.3g} times a second, but the log has {rate_hz:.4g} rows a second"
            f": the rows between {between}: it {cost} nothing of motion above {signal.rate_hz / 2:.3g} Hz; log it"
            " faster, or expect a model of slow motion only"
        )


def cut_offs(signals: Mapping[str, Array], rate_hz: float, slow: tuple[SlowSignal, ...]) -> dict[str, float]:
    """Find the cut-off, Hz, of the low-pass filter that a signal, uniform in time, went through before it was logged.

    Its spectrum falls off a cliff there: within an octave by 30 dB more than its trend of the octave before. A filter
    of low order falls too gently to be distinguished from motion, and one below 8 Hz looks like motion that ends. The
    cut-off is where the amplitude is halved, median over the columns that show it; left out are signals where most
    columns do not, and `slow` ones: straight lines between updates have a spectrum of their own.
    """
    left_out = _NOT_JUDGED | {signal.name for signal in slow}
    found = {}
    for name, values in signals.items():
        seen = []
        for octave, level in [] if name in left_out else [_spectrum(column, rate_hz) for column in values.T]:
            drops = [(_cliff(octave, level, at), at) for at in octave if 2**at >= _LOWEST_HZ]
            drop, at = max(drops, default=(0.0, 0.0))
            seen += [_halved(octave, level, at)] if drop > _CLIFF_DB else []
        if 2 * len(seen) > values.shape[1]:
            found[name] = float(np.median(seen))
    return found


def _spectrum(values: Array, rate_hz: float) -> tuple[Array, Array]:
    """Estimate the spectrum in dB in bands of an eighth of an octave, by the logarithm of their frequency (Welch)."""
    length = min(len(values) // _SEGMENTS, _LONGEST_SEGMENT)
    if length < _FEWEST_IN_SEGMENT or np.ptp(values) == 0:
        return np.empty(0), np.empty(0)
    from scipy.signal import welch

    frequency, power = welch(values, rate_hz, "blackmanharris", length, length // 2)
    # The window smears what is slower over its first lines.
    known = (frequency >= _LINES_OF_WINDOW * frequency[1]) & (frequency <= _HIGHEST_SHARE * rate_hz)
    octave, power = np.log2(frequency[known]), power[known]
    band = np.floor(_BANDS_PER_OCTAVE * (octave - octave[0])).astype(int)
    lines = np.maximum(np.bincount(band), 1)
    level = 10 * np.log10(np.bincount(band, power) / lines + _SMALLEST_POWER)
    filled = np.bincount(band) > 0
    return (np.bincount(band, octave) / lines)[filled], level[filled]


def _cliff(octave: Array, level: Array, at: float) -> float:
    """Measure how far a spectrum falls within an octave below its trend of the octave before, dB; 0 where no cliff."""
    before, beyond = (octave >= at - 1) & (octave <= at), octave >= min(at + 1, octave[-1])
    known = before.sum() >= _FEWEST_BANDS and octave[-1] - at >= _LEAST_OCTAVES_BEYOND
    # Most spectra have no cliff, and need no trend for that to be seen.
    if not known or level[before].min() - level[beyond].max() < _CLEARANCE_DB:
        return 0.0
    slope, offset = np.polyfit(octave[before], level[before], 1)
    if slope < -_STEEPEST_BEFORE_DB:
        return 0.0
    first = int(np.argmax(beyond))
    return float(offset + slope * at + min(slope, 0.0) * (octave[first] - at) - level[first])


def _halved(octave: Array, level: Array, cliff: float) -> float:
    """Find where a spectrum is a quarter of its trend, and the amplitude half; Hz."""
    before = (octave >= cliff - _TREND_OCTAVES) & (octave <= cliff - _CLEAR_OCTAVES)
    slope = min(0.0, float(np.polyfit(octave[before], level[before], 1)[0])) if before.sum() > 1 else 0.0
    trend = slope * octave + (level[before] - slope * octave[before]).mean()
    below = trend - level
    first = int(np.argmax((octave > cliff - _CLEAR_OCTAVES) & (below > _HALVED_DB)))
    if first == 0 or below[first] <= _HALVED_DB:
        return float(2**cliff)
    share = np.clip((_HALVED_DB - below[first - 1]) / (below[first] - below[first - 1]), 0.0, 1.0)
    return float(2 ** (octave[first - 1] + share * (octave[first] - octave[first - 1])))


def warn_of_cut_offs(found: Mapping[str, float], settings: ImportSettings) -> Iterator[str]:
    """Name the cut-offs of signals that were filtered before, unless the filter of the import lies below them all."""
    if not found or (settings.lowpass_hz is not None and settings.lowpass_hz <= min(found.values())):
        return
    named = ", ".join(f"{name} at about {cut_off:.2g} Hz" for name, cut_off in found.items())
    yield (
        f"the spectrum drops sharply: {named}; low-passed before logging (or simulated without noise)."
        " Nothing above that is known, and noise looks smaller than it was; signals that were filtered differently"
        f" no longer match: log them unfiltered, or set import.lowpass_hz to {min(found.values()):.2g} or less"
    )
