"""Read the columns of a log that a config maps, whatever kind of file it is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.stages.log_content import refuse_other_content
from cpfls_cli.stages.table import read_csv

LOG_SUFFIXES = (".csv", ".csv.gz", ".parquet", ".ulg")
"""How the name of a log may end."""


@dataclass(frozen=True)
class LogColumns:
    """Columns of a log.

    Attributes
    ----------
    columns : dict from str to array, shape (sample,)
        Those that the config maps; the others by name only, as empty arrays, so that a message can suggest them.
    warnings : tuple of str
        What is wrong with the file as a whole.
    """

    columns: dict[str, Array]
    warnings: tuple[str, ...] = ()


def is_log(path: Path) -> bool:
    """Tell by its name whether a file is a log."""
    return path.name.lower().endswith(LOG_SUFFIXES)


def read_log(path: Path, settings: ImportSettings) -> LogColumns:
    """Read a log.

    Parameters
    ----------
    settings : ImportSettings
        The section `import`.

    Raises
    ------
    InputError
        If its name ends in no kind of log, or in another than it holds, it cannot be read, or the package that reads
        it is not installed.
    """
    name = path.name.lower()
    if not is_log(path):
        raise InputError(f"{path}: not a log: its name must end in one of {', '.join(LOG_SUFFIXES)}")
    refuse_other_content(path)
    if name.endswith(".parquet"):
        from cpfls_cli.stages.parquet_log import read_parquet

        return LogColumns(read_parquet(path, settings.time_column, settings.time_unit, _wanted(settings)))
    if name.endswith(".ulg"):
        from cpfls_cli.stages.ulog import read_ulog

        return LogColumns(*read_ulog(path, settings))
    return LogColumns(read_csv(path, _wanted(settings)))


def _wanted(settings: ImportSettings) -> set[str]:
    return {settings.time_column} | {column for signal in settings.signals.values() for column in signal.columns}
