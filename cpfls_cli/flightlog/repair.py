"""Rows of a log on their way to a uniform clock: stamps that increase, no impossible values, spikes or long gaps."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, log10, pi

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cpfls_cli.arrays import Array, BoolArray, IntArray, runs
from cpfls_cli.blocks import mean_error
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.units import KNOWN_UNITS

_LARGEST_SHARE_BEHIND = 0.05  # Of all rows, up to which packets merely come late.
SMALLEST_SHARE_KEPT = 0.1  # Of a log, below which a crop that keeps it is not worth a word.
_SAME_RATE = 1e-3
# Measured, not derived: over 15 flights no gyroscope, torque or attitude has a value beyond 7, and 99 % of the single
# spikes of five standard deviations of their channel lie beyond 10.
_SUSPECTED_DEVIATIONS = 10.0
_DEVIATION_OF_MEDIAN = 1.4826  # Standard deviation of normal noise over the median of its departures.
# Far beyond what flies, by SI unit: what is larger is a broken value, or the unit is wrong.
_LARGEST = {"rad": 1e6, "rad/s": 1e5, "m": 1e9, "m/s": 1e5, "m/s^2": 1e6, "N m": 1e6, "N": 1e8, "V": 1e5, "1": 1e9}
_LARGEST |= {"s": 1e3}
_LARGEST_SHARE_BROKEN = 0.01  # Of values up to which some are broken, and not the unit wrong.
_LONG_STEP = 1.2  # Periods from which on rows may be missing between two.
_MISSING = 0.7  # Periods by which what comes behind a long step is later if a row is missing: the rest is waiting.
_NEAR = 10  # Rows before a long step, and behind it and what waited there, by which that is decided.
_FEW = 4  # Steps whose mean is a period though stamps are rounded, and among which few rows are missing.
_WANDERS = 201  # Rows over which a clock may drift.
_ONE_CLOCK = 100, 0.25  # Rows whose median follows one clock, and share of a period to which it does.
_LEAST_SCATTER = 0.07  # Of stamps, share of a period: real logs whose stamps scatter by 0.05 show no harm.
_CURVE = 5  # Rows of which the middle one is compared with the cubic through the others.
_BOUNDLESS = 1e100  # Of no unit, and whose square is a number.
_SURELY = 3.0  # Standard errors.
_BLOCKS = 20  # Over which the mean is sure.


@dataclass(frozen=True)
class SignalTable:
    """Time stamps, s, and by name the mapped signals at them, shape (sample, column), in SI, absent values NaN."""

    time: Array
    signals: dict[str, Array]

    def rows(self, kept: slice | IntArray | BoolArray) -> "SignalTable":
        """Select rows."""
        return SignalTable(self.time[kept], {name: values[kept] for name, values in self.signals.items()})


def same_rate(rates_hz: Sequence[float]) -> bool:
    """Tell whether clocks are of one rate, so that one filter and one window suit them all."""
    return max(rates_hz) - min(rates_hz) <= _SAME_RATE * min(rates_hz)


def common_rate(rates_hz: Sequence[float]) -> float:
    """Give a round rate, Hz, at which logs of several rates become flights of one and none is thinned much."""
    slowest = (1 + _SAME_RATE) * min(rates_hz)
    digit = 10.0 ** (floor(log10(slowest)) - 2)
    return float(f"{floor(slowest / digit) * digit:.3g}")


def increasing_rows(time: Array) -> tuple[IntArray, dict[str, int]]:
    """Keep the rows whose stamp, shape (sample,), is later than every one before; count the others by reason."""
    finite = np.isfinite(time)
    latest = np.maximum.accumulate(np.where(finite, time, -np.inf))
    before = np.concatenate([[-np.inf], latest[:-1]])
    with np.errstate(invalid="ignore"):
        repeated, backward = finite & (time == before), finite & (time < before)
        kept = np.flatnonzero(finite & (time > before))
    dropped = {"time_not_finite": ~finite, "repeated_time": repeated, "backward_time": backward}
    return kept, {reason: int(rows.sum()) for reason, rows in dropped.items()}


def crop_and_order(table: SignalTable, settings: ImportSettings) -> tuple[SignalTable, dict[str, int]]:
    """Keep the rows inside `crop_s`, in numbers, and of these the ones whose stamps increase; count the others.

    The crop comes first, so that it can cut off a part whose clock went wrong. What leaves fewer than two rows, goes
    backward and stays behind, or empties a mapped column is refused.
    """
    begin, end = settings.crop_s if isinstance(settings.crop_s, tuple) else (-np.inf, np.inf)
    outside = (table.time < begin) | (table.time > end)
    inside = np.isfinite(table.time) & ~outside
    if settings.crop_s is not None and inside.sum() < 2:
        raise SettingError(
            "crop_s", f"leaves {inside.sum()} rows of a log of {np.nanmax(table.time):.6g} s; check import.time_unit"
        )
    table = table.rows(~outside)
    refuse_restart(table.time, np.flatnonzero(~outside) + 1)
    kept, dropped = increasing_rows(table.time)
    if len(kept) < 2:
        raise InputError("the log has fewer than two rows with increasing time stamps; check import.time_column")
    ordered = table.rows(kept)
    problems = [
        f"import.signals.{name}.columns: {column!r} has fewer than two values ({count}) in the"
        f" {len(kept)} rows that are read"
        for name, signal in settings.signals.items()
        for column, count in zip(signal.names, np.isfinite(ordered.signals[name]).sum(axis=0).tolist(), strict=True)
        if count < 2
    ]
    if problems:
        problems[-1] += "; map another column, or leave the signal out of import.signals"
        raise InputError("\n".join(problems))
    return ordered, dropped | {"crop": int(outside.sum())}


def refuse_restart(time: Array, rows: IntArray) -> None:
    """Refuse stamps, s, that go backward and stay behind; a packet that comes late is behind alone, and dropped.

    What counts are rows behind in runs of two or more, where they make up more than 5 % of all. The message says
    where, by the number of each row in the log from 1, and offers a crop only where it leaves one part of the log.
    """
    finite = np.isfinite(time)
    time, rows = time[finite], rows[finite]
    if not _too_many(_behind(time)):
        return
    first, after = max(runs(_behind(time)), key=lambda run: run[1] - run[0])
    kept = {}
    for begin, end in _crops(time):
        own = time[(time >= begin) & (time <= end)]
        # A crop within which the clock goes back keeps nothing.
        if len(own) > SMALLEST_SHARE_KEPT * len(time) and not _too_many(_behind(own)):
            kept[(begin, end)] = len(own)
    remedy = "split the log (import.crop_s cannot tell the parts apart: their time stamps overlap)"
    if kept:
        crop = max(kept, key=kept.__getitem__)
        remedy = f"split the log, or keep one part of {kept[crop]} rows with import.crop_s = [{crop[0]:g}, {crop[1]:g}]"
    raise InputError(
        f"time goes backward at row {rows[first]} (from {time[first - 1]:.6g} s to {time[first]:.6g} s after the first"
        f" stamp) and stays behind for {after - first} rows: the clock was reset or logs were joined; {remedy}"
    )


def _crops(time: Array) -> set[tuple[float, float]]:
    """List the intervals of time that may hold one part of the log: before, beyond and among the stamps behind."""
    behind = _behind(time)
    lowest, highest = float(time[behind].min()), float(time[behind].max())
    earlier, later = time[~behind & (time < lowest)], time[~behind & (time > highest)]
    stretches = [(0.0, max(0.0, highest)), (max(0.0, lowest), highest)]
    stretches += [(0.0, float(earlier.max()))] if len(earlier) else []
    stretches += [(max(0.0, float(later.min())), float(time.max()))] if len(later) else []
    return {(float(f"{begin:g}"), float(f"{end:g}")) for begin, end in stretches if begin < end}


def _too_many(behind: BoolArray) -> bool:
    """Tell whether more rows are behind than come late one by one."""
    return sum(end - begin for begin, end in runs(behind) if end - begin > 1) > _LARGEST_SHARE_BEHIND * len(behind)


def _behind(time: Array) -> BoolArray:
    return np.asarray(time < np.maximum.accumulate(time), dtype=bool)


def longest_stretch(time: Array, present: BoolArray, settings: ImportSettings) -> tuple[slice, dict[str, int]]:
    """Find the longest stretch in which no column lacks values for longer than `gap_s`, as `gap_rule` has it.

    `present`, shape (sample, column), is where each column has a value. Given back are the rows, how many are left out
    as a column has no value yet or any more, and how many beyond a gap.
    """
    if (present.sum(axis=0) < 2).any():
        raise InputError("a mapped column has fewer than two values in the part of the log that is read")
    # Between these rows every column has begun and none has ended.
    first_full = int(np.argmax(present, axis=0).max())
    last_full = len(present) - 1 - int(np.argmax(present[::-1], axis=0).max())
    if first_full >= last_full:
        raise InputError("the mapped columns of the log have no period of time in common")
    gaps = _gap_steps(time, present, settings.gap_s)[first_full:last_full]
    if gaps.any() and settings.gap_rule == "stop":
        begin, end = (time[first_full + row] for row in runs(gaps)[0])
        raise InputError(
            _slow_log(time, present, settings)
            or f"the log has a gap of {end - begin:.3g} s at {begin:.3f} s, longer than import.gap_s ="
            f" {settings.gap_s:g}: raise it, crop with import.crop_s, or set import.gap_rule to longest-part"
        )
    stretches = [(first_full + begin, first_full + end) for begin, end in runs(~gaps)]
    if not stretches:
        raise InputError(
            _slow_log(time, present, settings)
            or "no part of the log has values in all mapped columns; check import.signals and import.gap_s"
        )
    first, last = max(stretches, key=lambda run: float(time[run[1]] - time[run[0]]))
    incomplete = first_full + len(time) - 1 - last_full
    return slice(first, last + 1), {"incomplete_ends": incomplete, "gap": len(time) - incomplete - (last + 1 - first)}


def _slow_log(time: Array, present: BoolArray, settings: ImportSettings) -> str | None:
    """Describe a log whose median step, not a gap in it, exceeds the longest gap allowed; None if it does not."""
    step = float(np.median(np.diff(time)))
    slowest = max(float(np.median(np.diff(time[column]))) for column in present.T)
    if step > settings.gap_s:
        return (
            f"the median step is {step:.3g} s, longer than import.gap_s = {settings.gap_s:g}: check import.time_unit ="
            f" {settings.time_unit}, or raise import.gap_s"
        )
    if slowest > settings.gap_s:
        return (
            f"a mapped column has a value only every {slowest:.3g} s (median), longer than import.gap_s ="
            f" {settings.gap_s:g}: raise import.gap_s, or leave its signal out of import.signals"
        )
    return None


def _gap_steps(time: Array, present: BoolArray, gap_s: float) -> BoolArray:
    """Mark the steps from row to row that lie inside a long gap of some column."""
    depth = np.zeros(len(time), dtype=int)
    for column in present.T:
        known = np.flatnonzero(column)
        # Stamps are rounded, so a gap of exactly the allowed length must pass.
        long = np.flatnonzero(np.diff(time[known]) > gap_s * (1 + 1e-9))
        depth[known[long]] += 1
        depth[known[long + 1]] -= 1
    return np.asarray(np.cumsum(depth)[:-1] > 0, dtype=bool)


def mask_impossible(table: SignalTable, settings: ImportSettings) -> tuple[SignalTable, tuple[str, ...]]:
    """Take values that no flight has, and quaternions without a length, for absent ones; warn of each such column.

    A column that holds many of them is refused.
    """
    warnings: list[str] = []
    signals = dict(table.signals)
    for name, signal in settings.signals.items():
        values, unit = signals[name], KNOWN_UNITS[signal.unit].si
        with np.errstate(invalid="ignore"):
            broken = np.abs(values) > _LARGEST[unit]
        for column in np.flatnonzero(broken.any(axis=0)):
            marked = broken[:, column]
            first = int(np.argmax(marked))
            text = (
                f"column {signal.names[column]!r} holds {int(marked.sum())} of {len(values)} values that no flight has,"
                f" the first {values[first, column]:.3g} in row {first + 1}"
                f" (beyond {_LARGEST[unit]:g}{'' if unit == '1' else f' {unit}'})"
            )
            if marked.mean() > _LARGEST_SHARE_BROKEN:
                raise InputError(f"import.signals.{name}: {text}: check its unit, scale and offset, or leave it out")
            warnings.append(f"{name}: {text}: taken as missing")
        if name == "quaternion" and not (turned := values.any(axis=1, keepdims=True)).all():
            rows, broken = int((~turned).sum()), broken | ~turned
            warnings.append(f"quaternion: {rows} rows are 0 0 0 0, not an attitude: taken as missing")
        signals[name] = np.where(broken, np.nan, values)
    return SignalTable(table.time, signals), tuple(warnings)


def find_signal_spikes(table: SignalTable, settings: ImportSettings) -> dict[str, BoolArray]:
    """Mark spikes, shape (sample, column), or without `spike_deviations` what is suspected of being one.

    Rotor commands have none: they jump.
    """
    deviations, window = settings.spike_deviations or _SUSPECTED_DEVIATIONS, settings.spike_window_samples
    spikes = {
        name: np.column_stack([find_spikes(column, deviations, window) for column in values.T])
        for name, values in table.signals.items()
    }
    if "rotor_command" in spikes:
        spikes["rotor_command"][:] = False
    return spikes


def find_spikes(values: Array, deviations: float, window: int) -> BoolArray:
    """Find spikes by Hampel's identifier, ``|x - median| > deviations * scale`` (F. R. Hampel, 1974).

    The scale is the largest of 1.4826 times the median departure from the median within the running window, 1.4826
    times the median departure of the whole channel from its running median, and the channel's mean step. The first is
    large where the signal turns fast, so that a resolved crest is not a spike; the last two keep a quiet stretch, and a
    signal of few distinct values, from being taken for spikes. Values that are not finite are none.
    """
    spikes = np.zeros(len(values), dtype=bool)
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 2:
        return spikes
    # Mirrored at the ends, where repetition would hide a spike.
    padded = np.pad(values[known], (window // 2, window - 1 - window // 2), mode="reflect")
    around = np.asarray(sliding_window_view(padded, window), dtype=float)

    def medians(rows: Array) -> Array:
        # A general median spends half its time on what is not finite.
        half, odd = divmod(window, 2)
        ordered = np.partition(rows, [half] if odd else [half - 1, half], axis=1)
        return np.asarray(ordered[:, half] if odd else 0.5 * (ordered[:, half - 1] + ordered[:, half]))

    median = medians(around)
    departure = np.abs(values[known] - median)
    scale = _DEVIATION_OF_MEDIAN * np.maximum(medians(np.abs(around - median[:, None])), np.median(departure))
    spikes[known] = departure > deviations * np.maximum(scale, np.abs(np.diff(values[known])).mean())
    return spikes


def count_saturated(values: Array, samples: int, rest: float | None = None) -> int:
    """Count the values of a channel in runs of so many samples at an extreme, but for that at which it may rest."""
    known = values[np.isfinite(values)]
    if len(known) == 0 or known.min() == known.max():
        return 0
    extremes = [extreme for extreme in (known.min(), known.max()) if extreme != rest]
    lengths = [after - first for extreme in extremes for first, after in runs(known == extreme)]
    return sum(length for length in lengths if length >= samples)


def fill(time: Array, values: Array, target: Array) -> Array:
    """Interpolate the finite ones of values, shape (sample, column), linearly at other times, shape (time,), s."""
    known = np.isfinite(values)
    return np.column_stack([np.interp(target, time[k], v[k]) for k, v in zip(known.T, values.T, strict=True)])


def unwrap_angles(angles: Array, turn: float = 2 * pi) -> Array:
    """Unwrap angles, shape (sample,), also across absent values, by a full turn in their unit; rad if not given."""
    known = np.isfinite(angles)
    continuous = np.array(angles, dtype=float)
    continuous[known] = np.unwrap(continuous[known], period=turn)
    return continuous


def continuous_attitude(attitude: Array) -> Array:
    """Unwrap roll and yaw of angles, shape (sample, 3), rad; a pitch does not jump."""
    roll, pitch, yaw = attitude.T
    return np.column_stack([unwrap_angles(roll), pitch, unwrap_angles(yaw)])


def align_quaternion_signs(quaternion: Array) -> Array:
    """Give each quaternion, shape (sample, 4), the sign nearer to the previous one; q and -q are the same attitude."""
    known = np.isfinite(quaternion).all(axis=1)
    continuous = np.array(quaternion, dtype=float)
    present = continuous[known]
    flips = np.sign((present[1:] * present[:-1]).sum(axis=1))
    continuous[known] = present * np.cumprod(np.concatenate([[1.0], np.where(flips < 0, -1.0, 1.0)]))[:, None]
    return continuous


def regular_stamps(time: Array, motion: Sequence[Array], of: str = "") -> tuple[Array, list[str]]:
    """Take the regular clock about which stamps scatter, where the motion is surely smoother along it, and say so.

    Messages wait for a bus or a disk, and are stamped as they arrive, though a sensor is read regularly. A row is
    placed on the regular clock; gaps of lost rows stay, and so does a slow drift of the clock.

    Parameters
    ----------
    time : array, shape (sample,), s
    motion : sequence of array, shape (sample,) or (sample, column)
        What is smooth in time; absent values NaN.
    of : str
        Whose stamps they are, in the sentence.

    Returns
    -------
    array, shape (sample,), s
        The stamps as given where they are regular, or the motion does not show that they should be.
    list of str
        A sentence where they are others.
    """
    from scipy.signal import savgol_filter

    steps = np.diff(time)
    if not motion or len(time) < _BLOCKS * _CURVE or not ((steps > 0) & np.isfinite(steps)).all():
        return time, []
    period, line = float(np.median(time[_FEW:] - time[:-_FEW])) / _FEW, np.empty(0)
    for _ in range(2):
        rows = _counted_rows(time, period)
        line = np.polyfit(rows, time, 1)
        period = float(line[0])
    late = time - np.polyval(line, rows)
    block, share = _ONE_CLOCK
    medians = np.median(late[: len(late) // block * block].reshape(-1, block), axis=1)
    # Nor is it one clock whose rate changes, that begins anew behind a pause, or of which rows are miscounted.
    if np.abs(np.diff(medians)).max(initial=0.0) > share * period:
        return time, []
    late -= savgol_filter(late, min(_WANDERS, len(late) - 1 + len(late) % 2), 1)
    regular = time - late
    if late.std() < _LEAST_SCATTER * period or not (np.diff(regular) > 0).all():
        return time, []
    whole = rows[_CURVE - 1 :] - rows[: 1 - _CURVE] == _CURVE - 1
    columns = np.column_stack(motion)
    columns = np.where(np.abs(columns) < _BOUNDLESS, columns, np.nan)
    given, other = (_beyond_cubic(stamps, columns)[whole] ** 2 for stamps in (time, regular))
    if len(given) < _BLOCKS:
        return time, []
    size = np.nan_to_num(given).mean(axis=0)
    gained = np.nan_to_num(given - other)[:, size > 0] @ (1 / size[size > 0])
    blocks = np.array([own.mean() for own in np.array_split(gained, _BLOCKS)])
    if blocks.mean() <= _SURELY * mean_error(blocks):
        return time, []
    words = f"stamps{of} scatter by {1e3 * late.std():.2g} ms about a regular clock of {1 / line[0]:.4g} Hz"
    return regular, [f"{words}, along which the motion is surely smoother: rows are placed on that clock"]


def _counted_rows(time: Array, period: float) -> Array:
    """Count the ticks before each row, of a clock of such a period, s: rows may be missing."""
    steps = np.diff(time)
    early, missing = time - period * np.arange(len(time)), np.zeros(len(time))
    on_time = np.append(np.flatnonzero(steps >= period / _LONG_STEP), len(time) - 1)
    long, total = np.flatnonzero(steps > _LONG_STEP * period) + 1, 0.0
    ends = on_time[np.searchsorted(on_time, long)] + _NEAR
    for row, end, following in zip(long, ends, np.append(long, len(time))[1:], strict=True):
        # What arrives late is followed by what waited for it, and that by what does not.
        before = (early[max(0, row - _NEAR) : row] - period * missing[max(0, row - _NEAR) : row]).min()
        found = np.floor((early[row:end].min() - period * total - before) / period + 1 - _MISSING)
        total += max(0.0, found)
        missing[row:following] = total
    return np.asarray(np.arange(len(time)) + missing)


def _beyond_cubic(time: Array, motion: Array) -> Array:
    """Compare each row with the cubic through the two before and the two behind it, per standard error of both."""
    stamps, values = sliding_window_view(time, _CURVE), sliding_window_view(motion, _CURVE, axis=0)
    middle, others = _CURVE // 2, [place for place in range(_CURVE) if place != _CURVE // 2]
    weights = np.zeros_like(stamps)
    for own in others:
        rest = [place for place in others if place != own]
        apart = (stamps[:, [middle]] - stamps[:, rest]) / (stamps[:, [own]] - stamps[:, rest])
        weights[:, own] = -apart.prod(axis=1)
    weights[:, middle] = 1.0
    return np.asarray(np.einsum("nw,ncw->nc", weights, values) / np.linalg.norm(weights, axis=1)[:, None])
