"""Reader of ULog, as PX4 writes it: topics, each with stamps in microseconds."""

from __future__ import annotations

import io
import struct
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import pyulog

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.flightlog.topics import STAMP, on_one_clock, topic_and_field
from cpfls_cli.logs.formats import ULOG_MAGIC, LogColumns
from cpfls_cli.units import known_unit

_MICROSECOND = 1e-6


def read(path: Path, settings: ImportSettings) -> LogColumns:
    """Read the mapped columns, ``topic.field`` or ``topic[instance].field``, on the clock of one topic.

    Warnings name dropouts of the logger, a broken file and topics that are thinned.

    Parameters
    ----------
    settings : ImportSettings
        `time_column` names the stamps that are the clock; stamps are converted to `time_unit`.

    Raises
    ------
    InputError
        If the file is no ULog, or `time_column` names no stamps.
    """
    log, topics = _read(path, settings)
    base, stamp = topic_and_field(settings.time_column)
    if stamp not in topics.get(base, {}):
        raise InputError(
            f"{path}: import.time_column = {settings.time_column!r}: in a .ulg every topic has stamps; name those of"
            " the fastest one that is mapped, such as vehicle_angular_velocity.timestamp (topics:"
            f" {', '.join(sorted(topics)) or 'none'})"
        )
    origin = int(topics[base][stamp][0])
    try:
        columns, warnings = on_one_clock(_in_seconds(topics, origin), settings)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    columns[settings.time_column] = columns[settings.time_column] / known_unit(settings.time_unit).factor
    return LogColumns(columns, (*_warn_of_file(log, origin), *warnings))


def _read(path: Path, settings: ImportSettings) -> tuple[Any, dict[str, dict[str, Any]]]:
    """Read the mapped topics, or all topics where a mapped field is missing, so that a message can list them."""
    wanted = [topic_and_field(column) for column in settings.mapped_columns]
    log = _parsed(path, sorted({topic.partition("[")[0] for topic, _ in wanted}))
    if not all(field in _topics(log).get(topic, {}) for topic, field in wanted):
        log = _parsed(path, None)
    return log, _topics(log)


def _parsed(path: Path, topics: Sequence[str] | None) -> Any:
    try:
        # The reader prints what it finds wrong, which is asked for below, and leaves a file that it cannot read open.
        with path.open("rb") as stream, redirect_stdout(io.StringIO()):
            if stream.read(len(ULOG_MAGIC)) != ULOG_MAGIC:
                raise InputError(f"{path}: not a ULog file: it does not begin as one")
            stream.seek(0)
            return pyulog.ULog(stream, None if topics is None else list(topics))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    except (pyulog.core.ULogException, struct.error, ValueError, KeyError, IndexError, TypeError) as error:
        raise InputError(f"{path}: a broken ULog file: {error}") from None


def _topics(log: Any) -> dict[str, dict[str, Any]]:
    return {f"{data.name}[{data.multi_id}]" if data.multi_id else data.name: data.data for data in log.data_list}


def _in_seconds(topics: dict[str, dict[str, Any]], origin: int) -> dict[str, dict[str, Array]]:
    """Convert stamps to seconds from the origin; the difference of whole numbers is exact."""
    return {
        topic: {field: _field(field, values, origin) for field, values in fields.items()}
        for topic, fields in topics.items()
    }


def _field(field: str, values: Any, origin: int) -> Array:
    if field.startswith(STAMP):
        return np.asarray((values.astype(np.int64) - origin) * _MICROSECOND, dtype=float)
    return np.asarray(values, dtype=float)


def _warn_of_file(log: Any, origin: int) -> tuple[str, ...]:
    warnings = []
    if log.file_corruption:
        warnings.append("the file is broken in places; what could be read of it is used")
    if log.dropouts:
        longest = max(log.dropouts, key=lambda dropout: dropout.duration)
        total_s = 1e-3 * sum(dropout.duration for dropout in log.dropouts)
        at_s = (longest.timestamp - origin) * _MICROSECOND
        warnings.append(
            f"{len(log.dropouts)} dropouts of the logger, {total_s:.3g} s in all, the longest"
            f" {1e-3 * longest.duration:.3g} s at {at_s:.3f} s: samples are missing there"
        )
    return tuple(warnings)
