"""Numbers of flights, computed once for each content and config, and kept in a folder."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from cpfls_cli import store
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.changes.numbers import FlightNumbers, StatedFact, flight_numbers
from cpfls_cli.config.load import stored_study
from cpfls_cli.config.study import Study, resolved_yaml
from cpfls_cli.errors import InputError, visible
from cpfls_cli.flightlog.stated_vehicle import stated_vehicle
from cpfls_cli.flights.recordings import read_alone
from cpfls_cli.logs.formats import is_log, log_contents
from cpfls_cli.version import code_fingerprint

FOLDER = "flights"
"""Of the folder that a command fills, where numbers are kept."""

_HASH = 8
"""Digits by which flights of one name are kept apart."""


def kept_numbers(
    flight: Path, file: InputFile, study: Study, folder: Path, cautions: Iterable[str] = ()
) -> FlightNumbers:
    """Give the numbers of a flight or log as they are kept in a folder, or compute them and keep them there.

    Those that are kept are taken where content, vehicle and import are the same, and the code of the program.

    Raises
    ------
    InputError
        If the flight has none.
    """
    kept = find_kept(flight, file, study, folder)
    if kept is not None:
        return kept
    read = read_alone(flight, study)
    has_gyroscope = "body_rate" in read.flight.signals
    made = replace(
        flight_numbers(read.recording, read.full_voltage, has_gyroscope=has_gyroscope),
        flown_at_s=read.flight.flown_at,
        code=code_fingerprint(),
        contradictions=tuple(read.contradictions),
        warnings=tuple(read.warnings),
        stated=tuple(StatedFact(name=name, value=value) for name, value in read.flight.stated.items()),
    )
    folder.mkdir(parents=True, exist_ok=True)
    origin = store.Origin(
        stage="flight-numbers",
        inputs={"flight": file},
        seed=study.seed,
        config=resolved_yaml(study),
        cautions=tuple(map(visible, cautions)),
    )
    store.write(_path(flight, file, folder), made, origin)
    return made


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


def find_kept(flight: Path, file: InputFile, study: Study, folder: Path) -> FlightNumbers | None:
    """Give the numbers of a flight as they are kept in a folder; None where those of another content or config are."""
    path = _path(flight, file, folder)
    if not path.is_file():
        return None
    try:
        kept, origin = store.read(path, FlightNumbers)
        made_by = stored_study(origin.config, path)
    except InputError:
        return None
    same = origin.inputs["flight"].sha256 == file.sha256 and kept.code == code_fingerprint()
    return kept if same and _of_flight(made_by) == _of_flight(study) else None


def _of_flight(study: Study) -> tuple[object, ...]:
    """Give what of a study the numbers of a flight follow from: a delay that is not given is found in a share of it."""
    return study.vehicle, study.import_, study.identification.training_share
