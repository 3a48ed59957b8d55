"""Reader of Parquet: the mapped columns only, as numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from pyarrow import parquet

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.logs.formats import LogColumns
from cpfls_cli.units import known_unit

_PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}


def read(path: Path, settings: ImportSettings) -> LogColumns:
    """Read the columns of a log that a config maps; nulls are NaN.

    Parameters
    ----------
    settings : ImportSettings
        Stamps whose type states a unit are converted to `time_unit`, from the first one; others are taken as they are.

    Raises
    ------
    InputError
        If the file is no Parquet or broken, has no rows or a name twice, or a mapped column does not hold numbers.
    """
    wanted = set(settings.mapped_columns)
    try:
        with parquet.ParquetFile(path) as file:
            names = file.schema_arrow.names
            _require_single(path, [name for name in names if name in wanted])
            table = file.read(columns=[name for name in names if name in wanted])
    except (OSError, pyarrow.ArrowException) as error:
        raise InputError(f"{path}: cannot be read as Parquet: {str(error).splitlines()[0]}") from None
    if file.metadata.num_rows == 0:
        raise InputError(f"{path}: holds column names but no samples")
    columns: dict[str, Array] = {name: np.empty(0) for name in names}
    for name in set(table.column_names) & wanted:
        columns[name] = _numbers(path, name, table.column(name))
        if name == settings.time_column and _states_unit(table.column(name).type):
            columns[name] /= known_unit(settings.time_unit).factor
    return LogColumns(columns)


def _require_single(path: Path, names: list[str]) -> None:
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise InputError(f"{path}: column '{repeated[0]}' stands twice")


def _numbers(path: Path, name: str, column: Any) -> Array:
    kind = column.type.value_type if pyarrow.types.is_dictionary(column.type) else column.type
    if _states_unit(kind):
        return _seconds(column)
    types = pyarrow.types
    numeric = (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal, types.is_null)
    if not any(is_kind(kind) for is_kind in numeric):
        raise InputError(
            f"{path}: column '{name}' holds {kind}: not numbers; map another column in import.signals, or write this "
            "one as numbers"
        )
    if types.is_boolean(kind):
        column = column.cast(pyarrow.int8())
    return np.asarray(column.cast(pyarrow.float64(), safe=False).to_numpy(), dtype=float)


def _states_unit(kind: Any) -> bool:
    return bool(pyarrow.types.is_timestamp(kind) or pyarrow.types.is_duration(kind) or pyarrow.types.is_time(kind))


def _seconds(column: Any) -> Array:
    """Convert stamps, whole numbers of their unit, to seconds from the first one; their difference is exact."""
    per_second = _PER_SECOND[column.type.unit]
    whole = pyarrow.int32() if pyarrow.types.is_time32(column.type) else pyarrow.int64()
    stamps = column.cast(whole).cast(pyarrow.int64())
    known = np.asarray(column.is_valid().to_numpy(), dtype=bool)
    numbers = stamps.fill_null(0).to_numpy()
    if not known.any():
        return np.full(len(numbers), np.nan)
    return np.where(known, (numbers - numbers[known][0]) / per_second, np.nan)
