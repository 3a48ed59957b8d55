"""Rows of a log on their way to a uniform clock: dropped, marked and repaired, with counts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.clock import increasing_rows
from cpfls_cli.flightlog.repair import count_saturated, find_spikes, without_jumps
from cpfls_cli.flightlog.settings import ImportSettings


@dataclass(frozen=True)
class Table:
    """Time stamps and the mapped signals at them, in SI, absent values NaN.

    Attributes
    ----------
    time : array, shape (sample,), s
    signals : dict from signal name to array, shape (sample, column)
    """

    time: Array
    signals: dict[str, Array]

    def rows(self, kept: slice | IntArray | BoolArray) -> Table:
        """Keep some rows."""
        return Table(self.time[kept], {name: values[kept] for name, values in self.signals.items()})

    def columns(self) -> Array:
        """Join all signals to one array, shape (sample, column)."""
        return np.hstack(list(self.signals.values()))


def in_order_and_cropped(table: Table, settings: ImportSettings) -> tuple[Table, dict[str, int]]:
    """Keep the rows whose time stamps increase and lie inside the crop.

    Parameters
    ----------
    table : Table
    settings : ImportSettings
        `crop_s`.

    Returns
    -------
    table : Table
        What is left.
    dropped : dict from str to int
        Rows dropped, by reason.

    Raises
    ------
    InputError
        If fewer than two rows are left.
    """
    kept, dropped = increasing_rows(table.time)
    table = table.rows(kept)
    begin, end = settings.crop_s or (-np.inf, np.inf)
    inside = (table.time >= begin) & (table.time <= end)
    if inside.sum() < 2:
        raise InputError("fewer than two rows of the log are left; see import.time_unit and import.crop_s")
    return table.rows(inside), dropped | {"crop": int((~inside).sum())}


def made_continuous(table: Table) -> Table:
    """Remove what is no motion: full turns of roll and yaw, and the change of sign of a quaternion.

    Parameters
    ----------
    table : Table

    Returns
    -------
    Table
        Signals that may be interpolated.
    """
    signals = dict(table.signals)
    if "attitude" in signals:
        roll, pitch, yaw = signals["attitude"].T
        signals["attitude"] = np.column_stack([without_jumps(roll), pitch, without_jumps(yaw)])
    if "quaternion" in signals:
        signals["quaternion"] = _same_sign(signals["quaternion"])
    return Table(table.time, signals)


def without_spikes(table: Table, settings: ImportSettings) -> tuple[Table, dict[str, int]]:
    """Make spikes absent values; commands of the rotors may jump and are left alone.

    Parameters
    ----------
    table : Table
    settings : ImportSettings
        `spike_deviations` (None: no test) and `spike_window_samples`.

    Returns
    -------
    table : Table
    spikes : dict from str to int
        Spikes by column of the log.
    """
    if settings.spike_deviations is None:
        return table, {}
    deviations, window = settings.spike_deviations, settings.spike_window_samples
    spikes = {
        name: np.column_stack([find_spikes(column, deviations, window) for column in values.T])
        for name, values in table.signals.items()
    }
    if "rotor_command" in spikes:
        spikes["rotor_command"][:] = False
    cleaned = {name: np.where(spikes[name], np.nan, values) for name, values in table.signals.items()}
    return Table(table.time, cleaned), _by_column(spikes, settings, lambda column: int(column.sum()))


def count_missing(table: Table, settings: ImportSettings) -> dict[str, int]:
    """Count the absent values of each column of the log, without those that have none.

    Parameters
    ----------
    table : Table
    settings : ImportSettings

    Returns
    -------
    dict of str to int
    """
    return _by_column(table.signals, settings, lambda column: int(np.isnan(column).sum()))


def count_stuck(table: Table, settings: ImportSettings) -> dict[str, int]:
    """Count the saturated values of each column of the log, without those that have none.

    Parameters
    ----------
    table : Table
    settings : ImportSettings

    Returns
    -------
    dict of str to int
    """
    return _by_column(table.signals, settings, lambda column: count_saturated(column, settings.saturation_samples))


def _by_column(
    signals: Mapping[str, Array | BoolArray], settings: ImportSettings, count: Callable[[Any], int]
) -> dict[str, int]:
    counts = {
        column: count(values)
        for name, signal in settings.signals.items()
        for column, values in zip(signal.columns, signals[name].T, strict=True)
    }
    return {column: number for column, number in counts.items() if number}


def _same_sign(quaternion: Array) -> Array:
    """Give each quaternion the sign that is nearer to the one before; q and -q are one attitude."""
    known = np.isfinite(quaternion).all(axis=1)
    present = quaternion[known]
    flips = np.sign((present[1:] * present[:-1]).sum(axis=1))
    continuous = quaternion.copy()
    continuous[known] = present * np.cumprod(np.concatenate([[1.0], np.where(flips < 0, -1.0, 1.0)]))[:, None]
    return continuous
