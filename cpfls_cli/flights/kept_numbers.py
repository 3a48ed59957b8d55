"""Numbers of flights, computed once for each content and config, and kept in a folder."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from cpfls_cli.artifacts.flight_numbers import FlightNumbersRecord
from cpfls_cli.artifacts.job import header_of
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.artifacts.store import holds, read_record, write_record
from cpfls_cli.changes.numbers import KINDS, flight_numbers
from cpfls_cli.config.load import stored_study
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.stated_vehicle import stated_vehicle
from cpfls_cli.flights.recordings import read_alone
from cpfls_cli.logs.formats import is_log, log_contents
from cpfls_cli.version import code_fingerprint

FOLDER = "flights"
"""Of the folder that a command fills, where numbers are kept."""

_HASH = 8
"""Digits by which flights of one name are told apart."""


def kept_numbers(
    flight: Path, file: InputFile, study: Study, folder: Path, cautions: Iterable[str] = ()
) -> FlightNumbersRecord:
    """Give the numbers of a flight or log as they are kept in a folder, or compute them and keep them there.

    Those that are kept are taken where content, vehicle and import are the same, and the code of the program.

    Raises
    ------
    InputError
        If the flight tells none.
    """
    kept = find_kept(flight, file, study, folder)
    if kept is not None:
        return kept
    read = read_alone(flight, study)
    has_gyroscope = "body_rate" in read.flight.signals
    told = flight_numbers(read.recording, read.full_voltage, has_gyroscope=has_gyroscope)
    made = FlightNumbersRecord.of(
        told,
        [KINDS[name.split()[0]].unit for name in told.values],
        read.recording.signals.period,
        read.flight.flown_at,
        code_fingerprint(),
        read.warnings,
        read.contradictions,
        read.flight.stated,
    )
    record = made.with_header(header_of(study, {"flight": file}, cautions))
    folder.mkdir(parents=True, exist_ok=True)
    write_record(_path(flight, file, folder), record)
    return record


def stated_of(flight: Path) -> dict[str, str]:
    """Read what a log states of its vehicle, whatever else it holds; nothing where it cannot be read."""
    if not is_log(flight):
        return {}
    try:
        contents = log_contents(flight, ())
    except InputError:
        return {}
    return stated_vehicle(contents.system, contents.parameters)


def with_absent_signals(study: Study) -> Study:
    """Let a log lack any signal but those that the import cannot do without."""
    signals = {name: replace(signal, required=False) for name, signal in study.import_.signals.items()}
    return study.model_copy(update={"import_": replace(study.import_, signals=signals)})


def _path(flight: Path, file: InputFile, folder: Path) -> Path:
    return folder / f"{flight.name}-{file.sha256[:_HASH]}.h5"


def find_kept(flight: Path, file: InputFile, study: Study, folder: Path) -> FlightNumbersRecord | None:
    """Give the numbers of a flight as they are kept in a folder; None where those of another content or config are."""
    path = _path(flight, file, folder)
    if not path.is_file() or not holds(path, FlightNumbersRecord):
        return None
    try:
        record = read_record(path, FlightNumbersRecord)
        made_by = stored_study(record.origin.config, path)
    except InputError:
        return None
    same = record.made_from("flight") == file.sha256 and record.code == code_fingerprint()
    return record if same and _of_flight(made_by) == _of_flight(study) else None


def _of_flight(study: Study) -> tuple[object, ...]:
    """Give what of a study the numbers of a flight follow from: a delay that is not given is found in a share of it."""
    return study.vehicle, study.import_, study.identification.training_share
