"""Numbers of a flight, as `changed` and `trend` keep them in their folders, and what both say of flights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from cpfls_cli.changes.numbers import FlightNumbers
from cpfls_cli.changes.results import CANNOT_TELL
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.stated_vehicle import autopilots_apart, ranges_apart, vehicles_apart
from cpfls_cli.flights.kept_numbers import FOLDER, kept_numbers
from cpfls_cli.pages.sensors import contradicted
from cpfls_cli.report.change_words import WORDS
from cpfls_cli.stage import Run, stage

CANNOT_TELL_CODE = 3
"""Exit code where it cannot be said whether a vehicle changed."""

_APART = 3
"""Facts that are named where two logs are of different vehicles."""


@stage(FlightNumbers, title="Numbers of each flight", words=WORDS, study=True)
def flight_numbers(run: Run, flight: Path) -> FlightNumbers:
    """Compute the numbers of a flight, or take those that are kept in the folder of the output."""
    return kept_numbers(flight, run.take({"flight": flight})["flight"], run.study, run.beside(FOLDER), run.cautions)


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


def stated_by(flights: Sequence[FlightNumbers]) -> list[tuple[str, Mapping[str, str]]]:
    """Give what the logs of flights state of their vehicles, with the names of the flights."""
    return [(own.name, own.facts) for own in flights]


def contradictions_of(flights: Sequence[FlightNumbers]) -> list[str]:
    """List what of flights contradicts itself or its vehicle, each with the name of its flight."""
    return [f"{own.name}: {words}" for own in flights for words in own.contradictions]
