"""Flights as sources of samples or stretches: read whole where they fit, else some rows at a time from their files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.gate import read_origin
from cpfls_cli.config.load import parse_config
from cpfls_cli.config.study import Study
from cpfls_cli.consistency.check import ENOUGH
from cpfls_cli.consistency.findings import Finding
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.settings import SETPOINTS
from cpfls_cli.flights.flight import MOTION, Flight, require_signals
from cpfls_cli.flights.recordings import (
    ReadFlight,
    check_flight,
    read_flight,
    units_of,
)
from cpfls_cli.identification.data import CHUNK, TorqueData, TorqueSource
from cpfls_cli.logs.formats import is_log
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.store import IN_MEMORY, check_rows, count_rows, held_rows, read, read_rows

_NEEDED = ("time", *MOTION)
_TORQUE = "torque"
_ROTORS = ("rotor-speed", "rotor-command")


@dataclass(frozen=True)
class FlightFile:
    """Samples, from `start` to before `stop`, that stay in their file.

    The path is absolute, because workers may read it too; `names` are paths of datasets: time, motion and, where it is
    asked for, torque. Size and rows are those of the file as it was opened; whoever reads it elsewhere, or later, must
    find the same.
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
        """Yield the samples, `CHUNK` at a time."""
        self._require_same_file()
        for rows in read_rows(self.path, self.names, self.start, self.stop, CHUNK):
            yield _torque_data(rows)

    def _require_same_file(self) -> None:
        if not self.path.is_file():
            fault = "no such file"
        elif (size := self.path.stat().st_size) != self.size_bytes:
            fault = f"another file, with {size} bytes instead of {self.size_bytes}"
        elif (rows := count_rows(self.path, Flight, self.names[0])) != self.rows:
            fault = f"another file, with {rows or 'no'} samples instead of {self.rows}"
        else:
            return
        raise InputError(
            f"{self.path}: {fault}; the workers of a scheduler also read a flight of more than {IN_MEMORY} samples "
            "from its file: put the same file there on each of their machines, and leave it unchanged"
        )


def flight_source(path: Path, *, torque: bool = True) -> TorqueSource:
    """Open a flight."""
    names = (*_NEEDED, _TORQUE) if torque else _NEEDED
    samples = count_rows(path, Flight, "time")
    if samples is None or samples <= IN_MEMORY:
        flight, _ = read(path, Flight)
        require_signals(path, flight.signals, *names)
        asked = {short: flight.signals[name] for name, short in SETPOINTS.items() if name in flight.signals}
        columns: dict[str, Array] = {name: own.reshape(len(own), -1) for name, own in asked.items()}
        return replace(_torque_data([getattr(flight, name) for name in names]), setpoints=columns)
    require_signals(path, held_rows(path, Flight), *names)
    check_rows(path, Flight, names)
    return FlightFile(path.resolve(), names, 0, samples, path.stat().st_size, samples)


def _torque_data(rows: Sequence[Array]) -> TorqueData:
    time, attitude, rate, acceleration = rows[: len(_NEEDED)]
    torque = rows[len(_NEEDED)] if len(rows) > len(_NEEDED) else np.zeros_like(attitude)
    return TorqueData(time, Motion(attitude, rate, acceleration), torque)


def part_of(source: TorqueSource, samples: slice) -> TorqueSource:
    """Take consecutive samples of a flight, a slice with a start and a stop."""
    if isinstance(source, FlightFile):
        return replace(source, start=source.start + samples.start, stop=source.start + samples.stop)
    assert isinstance(source, TorqueData)
    return source[samples]


def check_file(path: Path, study: Study, *, driven: bool = False) -> tuple[Finding, ...]:
    """Hold a flight against itself, its middle where it stays in its file; nothing of a flight of another vehicle.

    What drives it is held against the vehicle of the config if `driven`, else where its rotors give its torque.
    """
    try:
        return check_flight(_enough_of(path, study), study, driven=driven or torque_source_of(path, study) in _ROTORS)
    except InputError:
        return ()


def torque_source_of(path: Path, study: Study) -> str:
    """Say what gives the torque of a log, or of a flight that was imported; empty for one that was simulated."""
    if is_log(path):
        return study.import_.torque_source or ""
    made = read_origin(path)
    config = parse_config(made.config, f"{path}: /config")
    return str(config["import"]["torque_source"] or "") if "log" in made.inputs else ""


def _enough_of(path: Path, study: Study) -> ReadFlight:
    samples = None if is_log(path) else count_rows(path, Flight, "time")
    if samples is None or samples <= IN_MEMORY:
        return read_flight(path, study)
    names, first = held_rows(path, Flight), (samples - ENOUGH) // 2
    units = units_of(path, read_origin(path), study)
    return ReadFlight(path.name, _rows_in(path, names, first, first + ENOUGH), units, ())


def _rows_in(path: Path, names: Sequence[str], start: int, stop: int) -> Mapping[str, Array]:
    (read,) = read_rows(path, names, start, stop, max(stop - start, 1))
    return dict(zip(names, read, strict=True))
