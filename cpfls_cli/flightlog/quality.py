"""How good the columns of a log are: values that are absent, look like spikes, or stand at an extreme."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.flightlog.repair import count_saturated
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.flightlog.table import Table

_NEVER_SATURATED = {"quaternion", "voltage"}


@dataclass(frozen=True)
class ValueCounts:
    """Bad values by column of the log; columns without are left out.

    Attributes
    ----------
    missing : dict from str to int
        Absent.
    spikes, suspected_spikes : dict from str to int
        Spikes that are interpolated, and spikes that are left alone; one of the two is empty.
    saturated : dict from str to int
        In long runs at an extreme; not of a quaternion or a voltage, and not of rotors at rest.
    """

    missing: dict[str, int]
    spikes: dict[str, int]
    suspected_spikes: dict[str, int]
    saturated: dict[str, int]


def count_values(table: Table, spikes: Mapping[str, BoolArray], settings: ImportSettings) -> ValueCounts:
    """Count the bad values of each column of the log.

    Parameters
    ----------
    table : Table
        The part that is kept, as logged.
    spikes : mapping from signal name to array of bool, shape (sample, column)
        Where its spikes are.
    settings : ImportSettings
        The names of the columns, `spike_deviations` and `saturation_samples`.
    """
    found = _by_column(spikes, settings, lambda column: int(column.sum()))
    repaired = settings.spike_deviations is not None
    return ValueCounts(
        missing=_by_column(table.signals, settings, lambda column: int(np.isnan(column).sum())),
        spikes=found if repaired else {},
        suspected_spikes={} if repaired else found,
        saturated=_saturated(table, settings),
    )


def _saturated(table: Table, settings: ImportSettings) -> dict[str, int]:
    """Count saturated values; a hovering quaternion stands at 1, parked rotors at 0, and a voltage is coarse."""
    length = settings.saturation_samples
    rotors = {name: signal for name, signal in table.signals.items() if name.startswith("rotor")}
    others = {name: signal for name, signal in table.signals.items() if name not in _NEVER_SATURATED | rotors.keys()}
    return _by_column(rotors, settings, lambda column: count_saturated(column, length, rest=0.0)) | _by_column(
        others, settings, lambda column: count_saturated(column, length)
    )


def warn_of_values(counts: ValueCounts) -> tuple[str, ...]:
    """Say which columns hold values that look wrong and are used as they are."""
    saturated = (
        f"{column} stands at its extreme for {count} samples in all: saturated?"
        for column, count in counts.saturated.items()
    )
    suspected = (
        f"{count} suspected {'spike' if count == 1 else 'spikes'} in column {column}, used as logged: set"
        " import.spike_deviations to interpolate"
        for column, count in counts.suspected_spikes.items()
    )
    return (*saturated, *suspected)


def _by_column(
    signals: Mapping[str, Array | BoolArray], settings: ImportSettings, count: Callable[[Any], int]
) -> dict[str, int]:
    counts = {
        column: count(values)
        for name, signal in settings.signals.items()
        if name in signals
        for column, values in zip(signal.columns, signals[name].T, strict=True)
    }
    return {column: number for column, number in counts.items() if number}
