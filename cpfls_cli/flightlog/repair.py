"""Rows of a log on their way to a uniform clock: cropped, made continuous, spikes removed, absent values filled."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cpfls_cli.arrays import Array, BoolArray, IntArray, runs
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.flightlog.clock import increasing_rows, refuse_restart
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.units import KNOWN_UNITS

# Measured, not derived: over 15 flights no gyroscope, torque or attitude has a value beyond 7, and 99 % of the single
# spikes of five standard deviations of their channel lie beyond 10.
_SUSPECTED_DEVIATIONS = 10.0
_DEVIATION_OF_MEDIAN = 1.4826  # Standard deviation of normal noise over the median of its departures.
# Far beyond what flies, by SI unit: what is larger is a broken value, or the unit is wrong.
_LARGEST = {
    "rad": 1e6,
    "rad/s": 1e5,
    "m": 1e9,
    "m/s": 1e5,
    "m/s^2": 1e6,
    "N m": 1e6,
    "N": 1e8,
    "V": 1e5,
    "1": 1e9,
    "s": 1e3,
}
_LARGEST_SHARE_BROKEN = 0.01  # Of values up to which some are broken, and not the unit wrong.


@dataclass(frozen=True)
class SignalTable:
    """Time stamps and the mapped signals at them, in SI, absent values NaN.

    Attributes
    ----------
    time : array, shape (sample,), s
    signals : dict from signal name to array, shape (sample, column)
    """

    time: Array
    signals: dict[str, Array]

    def rows(self, kept: slice | IntArray | BoolArray) -> "SignalTable":
        """Select rows."""
        return SignalTable(self.time[kept], {name: values[kept] for name, values in self.signals.items()})

    def columns(self) -> Array:
        """Join all signals to one array, shape (sample, column)."""
        return np.hstack(list(self.signals.values()))


def crop_and_order(table: SignalTable, settings: ImportSettings) -> tuple[SignalTable, dict[str, int]]:
    """Keep the rows that lie inside the crop, and of these the ones whose time stamps increase.

    The crop comes first, so that it can cut off a part whose clock went wrong.

    Parameters
    ----------
    settings : ImportSettings
        `crop_s`, in numbers.

    Returns
    -------
    table : Table
        The rows that remain.
    dropped : dict from str to int
        Rows dropped, by reason.

    Raises
    ------
    SettingError
        If the crop leaves fewer than two rows.
    InputError
        If the time stamps do, or go backward and stay behind, or a mapped column has fewer than two values there.
    """
    begin, end = settings.crop_s if isinstance(settings.crop_s, tuple) else (-np.inf, np.inf)
    outside = (table.time < begin) | (table.time > end)
    inside = np.isfinite(table.time) & ~outside
    if settings.crop_s is not None and inside.sum() < 2:
        raise SettingError(
            "crop_s",
            f"leaves {inside.sum()} rows of a log of {np.nanmax(table.time):.6g} s; check import.time_unit",
        )
    table = table.rows(~outside)
    refuse_restart(table.time, np.flatnonzero(~outside) + 1)
    kept, dropped = increasing_rows(table.time)
    if len(kept) < 2:
        raise InputError("the log has fewer than two rows with increasing time stamps; check import.time_column")
    ordered = table.rows(kept)
    _require_values(ordered, settings)
    return ordered, dropped | {"crop": int(outside.sum())}


def _require_values(table: SignalTable, settings: ImportSettings) -> None:
    """Refuse columns that are empty in the part of the log that is read, by their names."""
    problems = [
        f"import.signals.{name}.columns: {column!r} has fewer than two values ({count}) in the"
        f" {len(table.time)} rows that are read"
        for name, signal in settings.signals.items()
        for column, count in zip(signal.names, np.isfinite(table.signals[name]).sum(axis=0).tolist(), strict=True)
        if count < 2
    ]
    if problems:
        problems[-1] += "; map another column, or leave the signal out of import.signals"
        raise InputError("\n".join(problems))


def mask_impossible(table: SignalTable, settings: ImportSettings) -> tuple[SignalTable, tuple[str, ...]]:
    """Take values that no flight has, and quaternions without a length, for absent ones.

    Returns
    -------
    table : Table
    warnings : tuple of str
        One for each column that held any.

    Raises
    ------
    InputError
        If a column holds many of them.
    """
    warnings: list[str] = []
    signals = dict(table.signals)
    for name, signal in settings.signals.items():
        values, unit = signals[name], KNOWN_UNITS[signal.unit].si
        with np.errstate(invalid="ignore"):
            broken = np.abs(values) > _LARGEST[unit]
        for column, (label, marked) in enumerate(zip(signal.names, broken.T, strict=True)):
            if marked.any():
                warnings.append(_broken(name, label, unit, values[:, column], marked))
        if name == "quaternion":
            without = ~np.any(values, axis=1, keepdims=True)
            broken = broken | without
            rows = int(without.sum())
            warnings += [f"quaternion: {rows} rows are 0 0 0 0, not an attitude: taken as missing"] if rows else []
        signals[name] = np.where(broken, np.nan, values)
    return SignalTable(table.time, signals), tuple(warnings)


def _broken(name: str, column: str, unit: str, values: Array, marked: BoolArray) -> str:
    first = int(np.argmax(marked))
    text = (
        f"column {column!r} holds {int(marked.sum())} of {len(values)} values that no flight has, the first"
        f" {values[first]:.3g} in row {first + 1} (beyond {_LARGEST[unit]:g}{'' if unit == '1' else f' {unit}'})"
    )
    if marked.mean() > _LARGEST_SHARE_BROKEN:
        raise InputError(f"import.signals.{name}: {text}: check its unit, scale and offset, or leave it out")
    return f"{name}: {text}: taken as missing"


def make_continuous(table: SignalTable) -> SignalTable:
    """Remove jumps that are not motion, full turns of roll and yaw and signs of a quaternion, for interpolation."""
    signals = dict(table.signals)
    if "attitude" in signals:
        roll, pitch, yaw = signals["attitude"].T
        signals["attitude"] = np.column_stack([unwrap_angles(roll), pitch, unwrap_angles(yaw)])
    if "quaternion" in signals:
        signals["quaternion"] = align_quaternion_signs(signals["quaternion"])
    return SignalTable(table.time, signals)


def find_signal_spikes(table: SignalTable, settings: ImportSettings) -> dict[str, BoolArray]:
    """Mark the spikes, or without `spike_deviations` what is suspected of it, of all but rotor commands, which jump.

    Returns
    -------
    dict from signal name to array of bool, shape (sample, column)
    """
    deviations, window = settings.spike_deviations or _SUSPECTED_DEVIATIONS, settings.spike_window_samples
    spikes = {
        name: np.column_stack([find_spikes(column, deviations, window) for column in values.T])
        for name, values in table.signals.items()
    }
    if "rotor_command" in spikes:
        spikes["rotor_command"][:] = False
    return spikes


def mask_values(table: SignalTable, marked: Mapping[str, BoolArray]) -> SignalTable:
    """Replace marked values, by signal, shape (sample, column), by NaN."""
    signals = {name: np.where(marked[name], np.nan, values) for name, values in table.signals.items()}
    return SignalTable(table.time, signals)


def find_spikes(values: Array, deviations: float, window: int) -> BoolArray:
    """Find spikes by Hampel's identifier, ``|x - median| > deviations * scale``.

    The scale is the largest of 1.4826 times the median departure from the median within the running window, 1.4826
    times the median departure of the whole channel from its running median, and the channel's mean step. The first is
    large where the signal turns fast, so that a resolved crest is not a spike; the last two keep a quiet stretch, and a
    signal of few distinct values, from being taken for spikes.

    Parameters
    ----------
    values : array, shape (sample,)
        One channel; values that are not finite are not spikes.
    deviations : float
        Threshold in robust standard deviations.
    window : int
        Samples of the running median.

    Returns
    -------
    array of bool, shape (sample,)
        True at a spike.

    References
    ----------
    F. R. Hampel, The influence curve and its role in robust estimation, 1974.
    """
    spikes = np.zeros(len(values), dtype=bool)
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 2:
        return spikes
    around = _windows(values[known], window)
    median = _medians(around)
    departure = np.abs(values[known] - median)
    local = _medians(np.abs(around - median[:, None]))
    scale = _DEVIATION_OF_MEDIAN * np.maximum(local, np.median(departure))
    spikes[known] = departure > deviations * np.maximum(scale, np.abs(np.diff(values[known])).mean())
    return spikes


def count_saturated(values: Array, samples: int, rest: float | None = None) -> int:
    """Count the values of a channel, shape (sample,), in runs at its smallest or largest one; 0 for a constant one.

    Parameters
    ----------
    samples : int
        Length from which a run counts.
    rest : float, optional
        Extreme at which the channel may stand without being saturated.
    """
    known = values[np.isfinite(values)]
    if len(known) == 0 or known.min() == known.max():
        return 0
    extremes = [extreme for extreme in (known.min(), known.max()) if extreme != rest]
    lengths = (after - first for extreme in extremes for first, after in runs(known == extreme))
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


def align_quaternion_signs(quaternion: Array) -> Array:
    """Give each quaternion, shape (sample, 4), the sign nearer to the previous one; q and -q are the same attitude."""
    known = np.isfinite(quaternion).all(axis=1)
    continuous = np.array(quaternion, dtype=float)
    present = continuous[known]
    flips = np.sign((present[1:] * present[:-1]).sum(axis=1))
    continuous[known] = present * np.cumprod(np.concatenate([[1.0], np.where(flips < 0, -1.0, 1.0)]))[:, None]
    return continuous


def _windows(values: Array, window: int) -> Array:
    """Collect the neighbours of each value; mirrored at the ends, where repetition would hide a spike."""
    before = window // 2
    padded = np.pad(values, (before, window - 1 - before), mode="reflect")
    return np.asarray(sliding_window_view(padded, window), dtype=float)


def _medians(rows: Array) -> Array:
    """Take the median of each row of finite values; a general one spends half its time on what is not finite."""
    half, odd = divmod(rows.shape[1], 2)
    ordered = np.partition(rows, [half] if odd else [half - 1, half], axis=1)
    return np.asarray(ordered[:, half] if odd else 0.5 * (ordered[:, half - 1] + ordered[:, half]))
