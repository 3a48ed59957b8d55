"""Flights as sources of samples: read whole where they fit, else chunk by chunk from their files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.flight import MOTION, FlightRecord
from cpfls_cli.artifacts.store import check_rows, count_rows, read_record, read_rows
from cpfls_cli.errors import InputError
from cpfls_cli.identification.data import CHUNK, TorqueData, TorqueSource
from cpfls_cli.regressor.motion import Motion

_NEEDED = ("time", *MOTION)
_TORQUE = "torque"

IN_MEMORY = 500_000
"""Samples of a flight that are held in memory, 52 MB of motion and torque."""


@dataclass(frozen=True)
class FlightFile:
    """Samples that stay in their file.

    Attributes
    ----------
    path : Path
        Absolute, because workers may read it too.
    names : tuple of str
        Paths of datasets: time, motion and, where it is asked for, torque.
    start, stop : int
        First sample, and the one after the last.
    size_bytes, rows : int
        Of the file as it was opened; whoever reads it elsewhere, or later, must find the same.
    """

    path: Path
    names: tuple[str, ...]
    start: int
    stop: int
    size_bytes: int
    rows: int

    def __len__(self) -> int:
        """Count the samples."""
        return self.stop - self.start

    def chunks(self) -> Iterator[TorqueData]:
        """Yield the samples, `CHUNK` at a time.

        Raises
        ------
        InputError
            If another file, or none, lies where this one was.
        """
        self._require_same_file()
        for rows in read_rows(self.path, self.names, self.start, self.stop, CHUNK):
            yield _torque_data(rows)

    def _require_same_file(self) -> None:
        if not self.path.is_file():
            fault = "no such file"
        elif (size := self.path.stat().st_size) != self.size_bytes:
            fault = f"another file, of {size} bytes instead of {self.size_bytes}"
        elif (rows := count_rows(self.path, FlightRecord.spec(), self.names[0])) != self.rows:
            fault = f"another file, with {rows or 'no'} samples instead of {self.rows}"
        else:
            return
        raise InputError(
            f"{self.path}: {fault}; a flight of more than {IN_MEMORY} samples is read from its file also by the "
            "workers of a scheduler: put the same file there on each of their machines, and leave it alone"
        )


def flight_source(path: Path, *, torque: bool = True) -> TorqueSource:
    """Open a flight.

    Parameters
    ----------
    torque : bool
        Whether its torque is needed; without, it counts as zero.

    Raises
    ------
    InputError
        If it is no flight, lacks a signal or breaks its format.
    """
    names = (*_NEEDED, _TORQUE) if torque else _NEEDED
    paths = tuple(FlightRecord.path(name) for name in names)
    samples = count_rows(path, FlightRecord.spec(), paths[0])
    if samples is None or samples <= IN_MEMORY:
        flight = read_record(path, FlightRecord, *names)
        return _torque_data([getattr(flight, name) for name in names])
    check_rows(path, FlightRecord.spec(), paths)
    return FlightFile(path.resolve(), paths, 0, samples, path.stat().st_size, samples)


def _torque_data(rows: Sequence[Array]) -> TorqueData:
    time, attitude, rate, acceleration = rows[: len(_NEEDED)]
    torque = rows[len(_NEEDED)] if len(rows) > len(_NEEDED) else np.zeros_like(attitude)
    return TorqueData(time, Motion(attitude, rate, acceleration), torque)


def part_of(source: TorqueSource, samples: slice) -> TorqueSource:
    """Take consecutive samples of a flight.

    Parameters
    ----------
    source : TorqueSource
        As `flight_source` gives it.
    samples : slice
        With a start and a stop.
    """
    if isinstance(source, FlightFile):
        return replace(source, start=source.start + samples.start, stop=source.start + samples.stop)
    assert isinstance(source, TorqueData)
    return source[samples]
