"""Rows of a log on their way to a uniform clock: dropped, made continuous, spikes marked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.flightlog.clock import increasing_rows
from cpfls_cli.flightlog.repair import find_spikes, same_sign, without_jumps
from cpfls_cli.flightlog.restart import refuse_restart
from cpfls_cli.flightlog.settings import ImportSettings

# Measured, not derived: over 15 flights no gyroscope, torque or attitude has a value beyond 7, and 99 % of the single
# spikes of five standard deviations of their channel lie beyond 10.
_SUSPECTED_DEVIATIONS = 10.0


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
    """Keep the rows that lie inside the crop, and of these the ones whose time stamps increase.

    The crop comes first, so that it can cut off a part whose clock went wrong.

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
    SettingError
        If the crop leaves fewer than two rows.
    InputError
        If the time stamps do, or go backward and stay behind, or a mapped column has fewer than two values there.
    """
    begin, end = settings.crop_s or (-np.inf, np.inf)
    outside = (table.time < begin) | (table.time > end)
    inside = np.isfinite(table.time) & ~outside
    if settings.crop_s is not None and inside.sum() < 2:
        raise SettingError(
            "crop_s",
            f"leaves {inside.sum()} rows of a log of {np.nanmax(table.time):.6g} s; see import.time_unit",
        )
    table = table.rows(~outside)
    refuse_restart(table.time, np.flatnonzero(~outside) + 1)
    kept, dropped = increasing_rows(table.time)
    if len(kept) < 2:
        raise InputError("the log has fewer than two rows of increasing time stamps; see import.time_column")
    left = table.rows(kept)
    _require_values(left, settings)
    return left, dropped | {"crop": int(outside.sum())}


def _require_values(table: Table, settings: ImportSettings) -> None:
    """Refuse columns that are empty in the part of the log that is read, by their names."""
    problems = [
        f"import.signals.{name}.columns: {column!r} has fewer than two values ({count}) in the"
        f" {len(table.time)} rows that are read"
        for name, signal in settings.signals.items()
        for column, count in zip(signal.columns, np.isfinite(table.signals[name]).sum(axis=0).tolist(), strict=True)
        if count < 2
    ]
    if problems:
        problems[-1] += "; map another column, or leave the signal out of import.signals"
        raise InputError("\n".join(problems))


def made_continuous(table: Table) -> Table:
    """Remove what is no motion: full turns of roll and yaw, and the change of sign of a quaternion.

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
        signals["quaternion"] = same_sign(signals["quaternion"])
    return Table(table.time, signals)


def find_table_spikes(table: Table, settings: ImportSettings) -> dict[str, BoolArray]:
    """Find the spikes of all signals; commands of the rotors may jump and have none.

    Parameters
    ----------
    table : Table
    settings : ImportSettings
        `spike_deviations` (None: those that are suspected) and `spike_window_samples`.

    Returns
    -------
    dict from signal name to array of bool, shape (sample, column)
        True at a spike.
    """
    deviations, window = settings.spike_deviations or _SUSPECTED_DEVIATIONS, settings.spike_window_samples
    spikes = {
        name: np.column_stack([find_spikes(column, deviations, window) for column in values.T])
        for name, values in table.signals.items()
    }
    if "rotor_command" in spikes:
        spikes["rotor_command"][:] = False
    return spikes


def without(table: Table, marked: Mapping[str, BoolArray]) -> Table:
    """Make the marked values absent.

    Parameters
    ----------
    table : Table
    marked : mapping from signal name to array of bool, shape (sample, column)
    """
    signals = {name: np.where(marked[name], np.nan, values) for name, values in table.signals.items()}
    return Table(table.time, signals)
