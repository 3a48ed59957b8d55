"""Command `changed`: what has changed about a vehicle between reference flights and flights of today."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from cpfls_cli.artifacts.changed import CANNOT_TELL, ChangedRecord
from cpfls_cli.artifacts.flight_numbers import FlightNumbersRecord
from cpfls_cli.artifacts.job import Job, finish, go_on, take_inputs
from cpfls_cli.artifacts.output import check_folder, filled_folder, refuse_inputs, write_text
from cpfls_cli.artifacts.rebuilt import numbers_of_flight
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.changes.causes import causes
from cpfls_cli.changes.judge import NAMED, Change, changed
from cpfls_cli.changes.numbers import KINDS, FlightNumbers
from cpfls_cli.changes.reference import FALSE_ALARM, FEWEST
from cpfls_cli.commands import report
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.stated_vehicle import autopilots_apart, ranges_apart, vehicles_apart
from cpfls_cli.flights.inputs import hashes_of, numbered_roles
from cpfls_cli.flights.kept_numbers import FOLDER, kept_numbers, stated_of, with_absent_signals
from cpfls_cli.pages.changed import LEFT_OUT, answer
from cpfls_cli.pages.source import source_of, unique_labels
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Command, Outcome, as_json
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import joined

FILES = ("changed.h5", "report.html", "changed.json")
"""What a folder holds in the end, beside the numbers of each flight."""

CANNOT_TELL_CODE = 3
"""Exit code where it cannot be told whether a vehicle changed."""

_NO_COLUMN = re.compile(r"import\.signals\.(?P<signal>\w+)\.columns: the log has no column '(?P<column>[^']+)'")

_APART = 3
"""Facts that are named where two logs are of different vehicles."""

_RATE = 0.01
"""By which sampling rates differ that are another."""

_UNLIKE = 0.7
"""Share of what a number may be off by that is not known for how flights are flown, from which on it is said: a half of
the variance."""


def run(
    job: Job, today: Sequence[Path], since: Sequence[Path], *, fail_on_change: bool = False, anyway: bool = False
) -> Outcome:
    """Hold flights of today against reference flights, and say what has changed."""
    given = numbered_roles("today", today) | numbered_roles("since", since)
    inputs = take_inputs(job, given)
    check_folder(job.output, job.force, FILES, kept=FOLDER)
    for name in FILES:
        refuse_inputs(job.output / name, job.inputs)
    kept, twice = once(given, inputs)
    if job.dry_run:
        line = Text(f"{job.output}: would be filled; the config and all inputs are good")
        return Outcome({"dry_run": True, "output": str(job.output)}, (line,))
    flights, left_out = _flights(job, kept, inputs, anyway=anyway)
    other = of_other_vehicles(stated_by([flights[role] for role in sorted(flights)]), anyway=anyway)
    record = _record(job, flights, [*left_out, *other, *twice])
    with filled_folder(job.output, FILES) as folder:
        written = finish(replace(job, output=folder / FILES[0]), record, {role: inputs[role] for role in flights})
        write_text(folder / FILES[2], json.dumps(as_json(written.summary), indent=1, allow_nan=False) + "\n")
        # Without a bar of its own: the bar is that of the whole.
        report.run(replace(job, output=folder / FILES[1], progress=lambda *_: None), [folder / FILES[0]])
    source = source_of(replace(job, output=job.output / FILES[0]), written)
    page = Text(f"{job.output / FILES[1]}: all of it, with the picture")
    failed = exit_code(written.verdict, fail_on_change=fail_on_change)
    return Outcome(
        written.summary, (*answer(source), page), failed, (_next(job, written, [kept[role] for role in flights]),)
    )


def exit_code(verdict: str, *, fail_on_change: bool = False) -> int:
    """Give the exit code of a verdict."""
    return CANNOT_TELL_CODE if verdict == CANNOT_TELL else int(fail_on_change and verdict == "CHANGED")


def of_other_vehicles(stated: Sequence[tuple[str, Mapping[str, str]]], *, anyway: bool) -> list[str]:
    """Refuse flights whose logs say that they are of different vehicles, or warn of them where that is asked for.

    Parameters
    ----------
    stated : sequence of (str, mapping of str to str)
        Flights and what their logs state of their vehicles; those that state nothing are passed over.
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


def of_other_autopilots(flights: Sequence[FlightNumbersRecord], *, loads: bool) -> tuple[list[str], list[str]]:
    """List where logs state another board, version or range of outputs than the first, and whose loads that touches.

    Parameters
    ----------
    loads : bool
        Whether loads are compared; of commands they are shares of what full throttle stands for.
    """
    (first, own), *others = [each for each in stated_by(flights) if each[1]] or [("", {})]
    unlike, ranges = [], []
    for name, facts in others:
        apart = autopilots_apart(own, facts)
        if apart:
            unlike.append(f"the logs of {first} and {name} state {', '.join(apart)}")
        if loads and flights[0].commanded and ranges_apart(own, facts):
            ranges.append(name)
    return unlike, ranges


def stated_by(flights: Sequence[FlightNumbersRecord]) -> list[tuple[str, Mapping[str, str]]]:
    """Give what the logs of flights state of their vehicles, with the names of the flights."""
    return [(own.flight, {} if own.stated is None else own.stated.facts) for own in flights]


def contradictions_of(flights: Sequence[FlightNumbersRecord]) -> list[str]:
    """List what of flights contradicts itself or its vehicle, each with the name of its flight."""
    return [f"{own.flight}: {words}" for own in flights for words in own.contradiction]


def once(given: Mapping[str, Path], inputs: Mapping[str, InputFile]) -> tuple[dict[str, Path], list[str]]:
    """Leave out copies of a flight; one that is of today and of the reference is refused."""
    known: dict[str, str] = {}
    kept, warnings = {}, []
    for role, path in given.items():
        hashes = hashes_of(path, inputs[role])
        same = next((known[each] for each in hashes if each in known), None)
        if same is None:
            kept[role] = path
            known.update(dict.fromkeys(hashes, role))
        elif same.partition("-")[0] != role.partition("-")[0]:
            also = "" if given[same].name == path.name else f", as {given[same]}"
            raise InputError(
                f"{path}: is both a flight of today and one of the reference (--reference){also}; leave it out of one"
            )
        else:
            warnings.append(f"{path.name}: is given twice, also as {given[same].name}; counted once")
    return kept, warnings


def _flights(
    job: Job, given: Mapping[str, Path], inputs: Mapping[str, InputFile], *, anyway: bool
) -> tuple[dict[str, FlightNumbersRecord], list[str]]:
    """Tell the numbers of all flights by role, under names that tell them apart; one that tells none is left out."""
    labels = unique_labels(list(given.values()))
    flights: dict[str, FlightNumbersRecord] = {}
    refused: dict[str, InputError] = {}
    for index, ((role, path), label) in enumerate(zip(given.items(), labels, strict=True)):
        job.progress(index, len(given), label)
        try:
            told = kept_numbers(path, inputs[role], job.study, job.output / FOLDER, job.cautions)
            flights[role] = replace(told, flight=label)
        except InputError as error:
            refused[role] = error
            if anyway:
                # Of another vehicle's log what it holds is compared.
                with suppress(InputError):
                    study = with_absent_signals(job.study)
                    told = kept_numbers(path, inputs[role], study, job.output / FOLDER, job.cautions)
                    flights[role] = replace(told, flight=label)
                    del refused[role]
    job.progress(len(given), len(given))
    if refused and not anyway:
        # Why a log is another vehicle's comes before what it lacks.
        by_role = dict(zip(given, labels, strict=True))
        stated = dict(stated_by(list(flights.values()))) | {by_role[role]: stated_of(given[role]) for role in refused}
        of_other_vehicles([(by_role[role], stated[by_role[role]]) for role in sorted(given)], anyway=anyway)
    for side in ("today", "since"):
        if not any(role.startswith(side) for role in flights):
            first = next(role for role in refused if role.startswith(side))
            raise InputError(_lacking(given[first], str(refused[first]), anyway=anyway))
    return flights, [f"{LEFT_OUT}{error}" for error in refused.values()]


def _lacking(path: Path, why: str, *, anyway: bool) -> str:
    """Say in one line which columns of the config a log lacks, if that is all, and what helps."""
    # What the log holds instead is a line of its own.
    found = [_NO_COLUMN.search(line) for line in why.splitlines() if "import.signals: " not in line]
    lacks = [(each["signal"], each["column"]) for each in found if each is not None]
    if anyway or not lacks or len(lacks) < len(found):
        return why
    signals, more = joined(dict.fromkeys(signal for signal, _ in lacks)), len(lacks) - 1
    return (
        f"{path}: has other columns than the config reads for {signals}: no {lacks[0][1]}"
        f"{f' and {more} more' if more else ''}; if it is the same vehicle, name those of this log as otherwise of "
        "import.signals, or give --anyway to compare without them"
    )


def _record(job: Job, flights: Mapping[str, FlightNumbersRecord], notes: Sequence[str]) -> ChangedRecord:
    vehicle = job.study.vehicle
    of_today, of_before = (
        [own for role, own in flights.items() if role.startswith(side)] for side in ("today", "since")
    )
    today, before = ([numbers_of_flight(own) for own in side] for side in (of_today, of_before))
    change = changed(today, before, vehicle, np.random.default_rng(job.study.seed))
    units = units_of(change.names, vehicle)
    loads = any(name.startswith("load ") for name in change.names)
    unlike, ranges = of_other_autopilots([*of_before, *of_today], loads=loads)
    warnings = [
        *notes,
        *_warnings(of_today, of_before, change.names),
        *_flown_unlike(change, today, before),
        *(f"{own.flight}: {words}" for own in (*of_today, *of_before) for words in own.warning),
    ]
    return ChangedRecord.of(
        *(change, today, before, units, warnings, contradictions_of([*of_today, *of_before])),
        false_alarm=FALSE_ALARM,
        named_from=NAMED,
        fewest=FEWEST,
        unlike=unlike,
        ranges=ranges,
    )


def units_of(names: Sequence[str], vehicle: VehicleSettings) -> dict[str, str]:
    """Look up the units of numbers and of the changes that they can tell of, by name."""
    units = {name: KINDS[name.split()[0]].unit for name in names}
    return units | {cause.name: cause.unit for cause in causes(names, vehicle)}


def _warnings(
    today: Sequence[FlightNumbersRecord], before: Sequence[FlightNumbersRecord], names: Sequence[str]
) -> Iterator[str]:
    """Say what the comparison lacks."""
    flights = [*before, *today]
    if len({own.commanded for own in flights}) > 1:
        speeds, commands = ([own.flight for own in flights if own.commanded == of] for of in (False, True))
        yield (
            f"speeds of rotors in {joined(speeds)}, commands in {joined(commands)}: loads are not compared; import the "
            "same signal of all"
        )
    elif flights[0].commanded and not all(np.isfinite(own.voltage) for own in flights):
        without = [own.flight for own in flights if not np.isfinite(own.voltage)]
        yield (
            f"without the battery's voltage: {'all flights' if len(without) == len(flights) else joined(without)}; an "
            "emptier battery looks like a heavier vehicle, so name import.signals.voltage"
        )
    usual = float(np.median([own.period for own in before]))
    other = [own for own in flights if abs(own.period / usual - 1) > _RATE]
    if other:
        listed = joined(f"{own.flight} ({1 / own.period:.4g} Hz)" for own in other)
        yield (
            f"another sampling rate than the usual one of the reference, {1 / usual:.4g} Hz: {listed}; what vibrates "
            "faster than half the rate looks otherwise there"
        )
    known = [numbers_of_flight(own) for own in flights]
    lost = [name for name in dict.fromkeys(name for own in known for name in own.values) if name not in names]
    if lost:
        by_flights: dict[str, list[str]] = {}
        for each in lost:
            by_flights.setdefault(joined(own.name for own in known if each not in own.values), []).append(each)
        listed = "; ".join(f"{joined(each)} (not {without})" for without, each in by_flights.items())
        yield f"not compared, for not all flights tell it: {listed}"


def _flown_unlike(change: Change, today: Sequence[FlightNumbers], before: Sequence[FlightNumbers]) -> Iterator[str]:
    """Say that today's flights are flown unlike those of the reference, where that makes them tell less."""
    reference = change.reference
    without = [flight.name for flight in [*before, *today] if not np.isfinite(flight.agility)]
    if without:
        yield (
            f"without attitude: {joined(without) if len(without) < len(before) + len(today) else 'all flights'}; how "
            f"{'any flight' if not np.isfinite(reference.agility) else 'it'} is flown is not known, and another way of "
            "flying can look like a change; import the attitude, or fly alike"
        )
    unsure = np.abs(reference.more_agile(today)).max() * reference.agility_error
    kinds = dict.fromkeys(
        name.split()[0] for name, less in zip(change.names, unsure > _UNLIKE * change.deviation, strict=True) if less
    )
    if kinds:
        now, then = ([flight.agility for flight in side if np.isfinite(flight.agility)] for side in (today, before))
        yield (
            f"flown unlike the reference: with accelerations of {_range(now)} m/s^2 (root mean square), those of "
            f"{_range(then)}; {joined(kinds)} count for less, as they go with it; take reference flights that are "
            "flown alike"
        )


def _range(values: Sequence[float]) -> str:
    low, high = f"{min(values):.2g}", f"{max(values):.2g}"
    return low if low == high else f"{low} to {high}"


def _next(job: Job, record: ChangedRecord, flown: Sequence[Path]) -> Command:
    """Give the command that goes on: what a model misses of the flights that changed, or the numbers of all flights."""
    if not record.changed:
        return "cpfls", "info", job.output / FILES[0], "-v"
    changed_ones = flown[record.since_flight : len(record.today)]
    return go_on(job, "gap", *changed_ones, output=job.beside("gap"))
