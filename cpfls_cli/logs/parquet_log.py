"""Reader of Parquet: the mapped columns only, as numbers."""

from collections import Counter
from collections.abc import Collection
from pathlib import Path
from textwrap import shorten
from typing import Any

import numpy as np
import pyarrow
from pyarrow import parquet

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import InputError
from cpfls_cli.files import most_held
from cpfls_cli.logs.formats import MOST_LISTED, LogContents
from cpfls_cli.words import some

_PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
_LONGEST = 200  # Characters of a message of the library, which may list all columns.


def contents(path: Path, wanted: Collection[str] | None = None) -> LogContents:
    """Read columns of a log; nulls are NaN, and stamps whose type states a unit count s from the first one."""
    try:
        with parquet.ParquetFile(path) as file:
            schema = file.schema_arrow
            kept = schema.names if wanted is None else [name for name in schema.names if name in wanted]
            repeated = sorted(name for name, count in Counter(kept).items() if count > 1)
            if repeated:
                raise InputError(f"{path}: column '{repeated[0]}' appears twice")
            held = 8 * file.metadata.num_rows * len(kept)
            if held > most_held(path.stat().st_size):
                raise InputError(
                    f"{path}: claims {held / 1e9:.3g} GB of numbers, far more than a file of its size holds"
                )
            table = file.read(columns=kept)
    # A column's name may be no text.
    except (OSError, pyarrow.ArrowException, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: cannot be read as Parquet: {shorten(str(error).splitlines()[0], _LONGEST, placeholder=' ...')}"
        ) from None
    if file.metadata.num_rows == 0:
        raise InputError(f"{path}: holds column names but no samples")
    left_out = [name for name in kept if wanted is None and not _is_numeric(schema.field(name).type)]
    columns: dict[str, Array] = {name: np.empty(0) for name in schema.names if name not in left_out}
    for name in set(columns) & set(kept):
        columns[name] = _numbers_of_column(path, name, table.column(name))
    warnings = (f"columns that hold no numbers are left out: {some(left_out, MOST_LISTED)}",) if left_out else ()
    units = {name: "s" for name in set(columns) & set(kept) if _states_unit(schema.field(name).type)}
    begins = {}
    for name in units:
        stamps, known = _stamps(table.column(name))
        begins[name] = float(stamps[known][0]) / _PER_SECOND[table.column(name).type.unit] if known.any() else 0.0
    return LogContents({"": columns}, units, warnings=warnings, begins=begins)


def _numbers_of_column(path: Path, name: str, column: Any) -> Array:
    if not _is_numeric(column.type):
        raise InputError(
            f"{path}: column '{name}' holds {_kind(column.type)}, not numbers; map another column in import.signals, "
            "or write this one as numbers"
        )
    if _states_unit(column.type):
        # Whole numbers of their unit, whose difference is exact.
        stamps, known = _stamps(column)
        since = (stamps - stamps[known][0] if known.any() else stamps) / _PER_SECOND[column.type.unit]
        return np.where(known, since, np.nan)
    if pyarrow.types.is_boolean(_kind(column.type)):
        column = column.cast(pyarrow.int8())
    return np.asarray(column.cast(pyarrow.float64(), safe=False).to_numpy(), dtype=float)


def _kind(kind: Any) -> Any:
    return kind.value_type if pyarrow.types.is_dictionary(kind) else kind


def _is_numeric(kind: Any) -> bool:
    types = pyarrow.types
    numeric = (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal, types.is_null)
    return _states_unit(kind) or any(is_kind(_kind(kind)) for is_kind in numeric)


def _states_unit(kind: Any) -> bool:
    return bool(pyarrow.types.is_timestamp(kind) or pyarrow.types.is_duration(kind) or pyarrow.types.is_time(kind))


def _stamps(column: Any) -> tuple[IntArray, BoolArray]:
    """Give stamps as whole numbers of their unit, 0 where there is none, and where there is one."""
    whole = pyarrow.int32() if pyarrow.types.is_time32(column.type) else pyarrow.int64()
    numbers = column.cast(whole).cast(pyarrow.int64()).fill_null(0).to_numpy()
    return numbers, np.asarray(column.is_valid().to_numpy(), dtype=bool)
