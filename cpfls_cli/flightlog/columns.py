"""Columns of a log: which mapped signals it holds, found by name and converted to SI."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import replace
from difflib import get_close_matches

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap
from cpfls_cli.units import to_si

_SUFFICIENT_SIGNALS = ("attitude", "quaternion", "body_rate", "rotor_speed", "rotor_command")


def drop_absent_signals(columns: Container[str], settings: ImportSettings) -> ImportSettings:
    """Leave out the optional signals whose columns the log does not hold.

    A signal with some of its columns stays, so that the missing ones are named like those of a required signal.

    Parameters
    ----------
    columns : container of str
        Names of the log's columns.
    settings : ImportSettings
        The section `import`.

    Returns
    -------
    ImportSettings
        With the remaining signals.

    Raises
    ------
    InputError
        If the remaining signals describe neither the rotation nor the rotors, or another key needs an absent one.
    """
    absent = [
        name
        for name, signal in settings.signals.items()
        if not signal.required and not any(column in columns for column in signal.columns)
    ]
    if not absent:
        return settings
    present = {name: signal for name, signal in settings.signals.items() if name not in absent}
    if not any(name in present for name in _SUFFICIENT_SIGNALS):
        raise InputError(
            f"import.signals: a flight needs one of {', '.join(_SUFFICIENT_SIGNALS)}; the log has no columns of"
            f" {', '.join(absent)}"
        )
    try:
        return replace(settings, signals=present)
    except SettingError as error:
        raise InputError(f"import.{error.key}: {error}; the log has no columns of {', '.join(absent)}") from None


def select_columns(columns: Mapping[str, Array], settings: ImportSettings) -> tuple[Array, dict[str, Array]]:
    """Take the time stamps and the mapped columns of a log, in SI and with their signs.

    Parameters
    ----------
    columns : mapping from str to array, shape (sample,)
        The log.
    settings : ImportSettings
        The section `import`.

    Returns
    -------
    time : array, shape (sample,), s
        Time stamps from 0.
    signals : dict from signal name to array, shape (sample, column), SI
        Frames and order as in the log.

    Raises
    ------
    InputError
        If columns are missing, empty or of unequal length; the message names all of them, the config key of each
        and the nearest columns of the log.
    """
    _require_present(columns, settings)
    time: Array = to_si(np.asarray(columns[settings.time_column], dtype=float), settings.time_unit)
    signals: dict[str, Array] = {name: _in_si(columns, signal) for name, signal in settings.signals.items()}
    for name, values in signals.items():
        if len(values) != len(time):
            raise InputError(f"import.signals.{name}.columns: {len(values)} values for {len(time)} time stamps")
    finite = time[np.isfinite(time)]
    if len(finite) < 2:
        raise InputError(f"import.time_column: {settings.time_column!r} holds fewer than two time stamps")
    return time - finite[0], signals


def _in_si(columns: Mapping[str, Array], signal: SignalMap) -> Array:
    values = np.column_stack([np.asarray(columns[name], dtype=float) for name in signal.columns])
    sign = np.ones(len(signal.columns)) if signal.sign is None else np.array(signal.sign)
    values[~np.isfinite(values)] = np.nan
    return to_si(sign * (signal.scale * values + signal.offset), signal.unit)


def _require_present(columns: Mapping[str, Array], settings: ImportSettings) -> None:
    if not settings.signals:
        raise InputError("import.signals: no signal is mapped to columns of the log")
    wanted = [("import.time_column", settings.time_column)]
    wanted += [
        (f"import.signals.{name}.columns", column)
        for name, signal in settings.signals.items()
        for column in signal.columns
    ]
    missing = [
        f"{key}: the log has no column {name!r}{_hint(name, columns)}" for key, name in wanted if name not in columns
    ]
    if missing:
        raise InputError("\n".join(missing))


def _hint(name: str, columns: Mapping[str, Array]) -> str:
    by_lower = {column.lower(): column for column in columns}
    nearest = [by_lower[match] for match in get_close_matches(name.lower(), by_lower, n=3, cutoff=0.5)]
    if nearest:
        return f" (nearest: {', '.join(nearest)})"
    # A log of topics has hundreds of columns.
    topics = sorted({column.partition(".")[0] for column in columns})
    if all("." in column for column in columns):
        return f" (topics: {', '.join(topics)})"
    return f" (columns: {', '.join(columns)})"
