"""Flights as sources of samples: read whole where they fit, else chunk by chunk from their files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.formats import FLIGHT
from cpfls_cli.artifacts.rows import check_rows, count_rows, read_rows
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.errors import InputError
from cpfls_cli.flights.sources import read_with
from cpfls_cli.identification.data import CHUNK, TorqueData, TorqueSource
from cpfls_cli.regressor.motion import Motion

MOTION = ("attitude", "attitude_rate", "attitude_acceleration")
_NEEDED = ("time", *MOTION)
_TORQUE = "torque"

IN_MEMORY = 500_000
"""Samples of a flight that are held in memory, 52 MB of motion and torque."""


def flight_motion(flight: Artifact) -> Motion:
    """Take the motion of a flight that was read whole."""
    attitude, rate, acceleration = (flight.array(name) for name in MOTION)
    return Motion(attitude, rate, acceleration)


@dataclass(frozen=True)
class FlightFile:
    """Samples that stay in their file.

    Attributes
    ----------
    path : Path
        Absolute, because workers may read it too.
    names : tuple of str
        Datasets: time, motion and, where it is asked for, torque.
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
            found = "no such file"
        elif (size := self.path.stat().st_size) != self.size_bytes:
            found = f"another file, of {size} bytes instead of {self.size_bytes}"
        elif (rows := count_rows(self.path, FLIGHT, self.names[0])) != self.rows:
            found = f"another file, with {rows or 'no'} samples instead of {self.rows}"
        else:
            return
        raise InputError(
            f"{self.path}: {found}; a flight of more than {IN_MEMORY} samples is read from its file also by the "
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
    samples = count_rows(path, FLIGHT, names[0])
    if samples is None or samples <= IN_MEMORY:
        flight = read_with(path, FLIGHT, *names)
        return _torque_data([flight.array(name) for name in names])
    check_rows(path, FLIGHT, names, CHUNK)
    return FlightFile(path.resolve(), names, 0, samples, path.stat().st_size, samples)


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
