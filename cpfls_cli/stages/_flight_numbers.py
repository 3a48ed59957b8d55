"""Numbers of a flight, as `changed` and `trend` keep them in their folders, and what both say of flights."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from cpfls_cli import store
from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.changes.numbers import FlightNumbers, StatedFact
from cpfls_cli.changes.numbers import flight_numbers as numbers_of
from cpfls_cli.changes.results import CANNOT_TELL
from cpfls_cli.config.load import stored_study
from cpfls_cli.config.study import Study, resolved_yaml
from cpfls_cli.errors import InputError, visible
from cpfls_cli.flightlog.stated_vehicle import autopilots_apart, ranges_apart, stated_vehicle, vehicles_apart
from cpfls_cli.flights.recordings import read_alone
from cpfls_cli.logs.formats import is_log, log_contents
from cpfls_cli.pages.trust import contradicted
from cpfls_cli.report.change_words import WORDS
from cpfls_cli.stage import Run, stage
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
    InputError if the flight has none.
    """
    kept = find_kept(flight, file, study, folder)
    if kept is not None:
        return kept
    read = read_alone(flight, study)
    has_gyroscope = "body_rate" in read.flight.signals
    made = replace(
        numbers_of(read.signals, read.full_voltage, has_gyroscope=has_gyroscope),
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


CANNOT_TELL_CODE = 3
"""Exit code where it cannot be said whether a vehicle changed."""

_APART = 3
"""Facts that are named where two logs are of different vehicles."""


@stage(FlightNumbers, title="Numbers of each flight", words=WORDS, study=True)
def flight_numbers(run: Run, flight: Path) -> FlightNumbers:
    """Compute the numbers of a flight, or take those that are kept in the folder of the output."""
    return kept_numbers(flight, run.take({"flight": flight})["flight"], run.study, run.sibling(FOLDER), run.cautions)


def exit_code(verdict: str, *, fail_on_change: bool = False) -> int:
    """Give the exit code of a verdict."""
    return CANNOT_TELL_CODE if verdict == CANNOT_TELL else int(fail_on_change and verdict == "CHANGED")


def first_of_each(contradictions: Sequence[str]) -> list[str]:
    """Say of each flight that contradicts itself what comes first."""
    return [contradicted(each) for each in {own.partition(": ")[0]: own for own in reversed(contradictions)}.values()]


def of_other_vehicles(stated: Sequence[tuple[str, Mapping[str, str]]], *, anyway: bool) -> list[str]:
    """Refuse flights whose logs say that they are of different vehicles, or warn of them where that is asked for.

    Flights that state nothing of their vehicles are passed over.
    """
    (first, own), *others = [each for each in stated if each[1]] or [("", {})]
    warnings = []
    for name, facts in others:
        apart = vehicles_apart(own, facts)
        if apart:
            differ = f"{first} and {name} are of different vehicles ({'; '.join(apart[:_APART])})"
            if not anyway:
                raise InputError(f"{differ}: compare flights of one vehicle, or give --anyway")
            warnings.append(f"{differ}, and are compared anyway")
    return warnings


def of_other_autopilots(flights: Sequence[FlightNumbers], *, thrusts: bool) -> tuple[list[str], list[str]]:
    """List where logs state another board, version or range of outputs, and whose shares of thrust that touches.

    `thrusts`: whether shares of thrust are compared; of commands they are shares of full throttle.
    """
    (first, own), *others = [each for each in stated_by(flights) if each[1]] or [("", {})]
    unlike, ranges = [], []
    for name, facts in others:
        apart = autopilots_apart(own, facts)
        if apart:
            unlike.append(f"the logs of {first} and {name} state {', '.join(apart)}")
        if thrusts and flights[0].commanded and ranges_apart(own, facts):
            ranges.append(name)
    return unlike, ranges


def without_voltage(which: str) -> str:
    """Say of which flights by commands the voltage of the battery is not known, and why it matters."""
    return (
        f"without the battery's voltage: {which}; an emptier battery looks like a heavier vehicle, so name "
        "import.signals.voltage"
    )


def stated_by(flights: Sequence[FlightNumbers]) -> list[tuple[str, Mapping[str, str]]]:
    """Give what the logs of flights state of their vehicles, with the names of the flights."""
    return [(own.name, own.facts) for own in flights]


def contradictions_of(flights: Sequence[FlightNumbers]) -> list[str]:
    """List what of flights contradicts itself or its vehicle, each with the name of its flight."""
    return [f"{own.name}: {words}" for own in flights for words in own.contradictions]
