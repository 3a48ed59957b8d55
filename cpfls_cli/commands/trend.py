"""Command `trend`: many flights of a vehicle in time, and since which of them what is changed."""

from __future__ import annotations

import csv
import io
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.artifacts.flight_numbers import FlightNumbersRecord
from cpfls_cli.artifacts.job import Job, finish, go_on, take_inputs
from cpfls_cli.artifacts.output import check_folder, filled_folder, refuse_inputs, write_text
from cpfls_cli.artifacts.rebuilt import numbers_of_flight
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.artifacts.store import format_name, holds
from cpfls_cli.artifacts.trend import TrendRecord
from cpfls_cli.changes.judge import NAMED
from cpfls_cli.changes.reference import FALSE_ALARM
from cpfls_cli.changes.trend import load_ruptures, trend
from cpfls_cli.commands import report
from cpfls_cli.commands.changed import (
    contradictions_of,
    exit_code,
    of_other_autopilots,
    of_other_vehicles,
    once,
    stated_by,
    units_of,
)
from cpfls_cli.config.study import Study, generator
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.flights.inputs import numbered_roles
from cpfls_cli.flights.kept_numbers import FOLDER, find_kept, kept_numbers
from cpfls_cli.logs.formats import is_log
from cpfls_cli.pages.source import source_of, unique_labels
from cpfls_cli.pages.trend import answer
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Command, Outcome, as_json
from cpfls_cli.workers.employ import employ

FILES = ("trend.h5", "report.html", "trend.json", "trend.csv")
"""What a folder holds in the end, beside the numbers of each flight."""

_FLIGHT = "cpfls/flight"
_COMPARED, _BEFORE = 3, 5
"""Flights that the command to go on with names: the last ones, and of the reference."""

_OF_A_LOG = (InputError, ComputationError)
"""Why a log tells nothing: where another does, it is left out."""


@dataclass(frozen=True)
class Options:
    """How a trend is asked for.

    Attributes
    ----------
    reference : int or None
        How many of the first flights are the reference; None for half of them at most.
    order : {"date", "name", "given"} or None
        None for date where every log has one, and name elsewhere.
    anyway : bool
        Whether flights are compared whose logs say that they are of different vehicles.
    """

    reference: int | None = None
    order: str | None = None
    anyway: bool = False
    workers: int = 1
    scheduler: str | None = None


def run(job: Job, given: Sequence[Path], options: Options) -> Outcome:
    """Hold the flights of a vehicle against each other in time, and say since when what is changed."""
    # Before logs are read, which takes long.
    load_ruptures()
    flights = numbered_roles("flight", list(_expanded(given, job.output)))
    inputs = take_inputs(job, flights)
    own = job.output / FILES[0]
    # A folder that it filled is one to add to.
    check_folder(job.output, job.force or (own.is_file() and holds(own, TrendRecord)), FILES, kept=FOLDER)
    for name in FILES:
        refuse_inputs(job.output / name, job.inputs)
    kept, notes = once(flights, inputs)
    if job.dry_run:
        line = Text(f"{job.output}: would be filled from {len(kept)} flights; the config and all inputs are good")
        return Outcome({"dry_run": True, "output": str(job.output)}, (line,))
    told, new, left_out = _told(job, kept, inputs, options)
    record = _record(job, told, options, [*left_out, *notes])
    with filled_folder(job.output, FILES) as folder:
        written = finish(replace(job, output=folder / FILES[0]), record, {role: inputs[role] for role in told})
        write_text(folder / FILES[2], json.dumps(as_json(written.summary), indent=1, allow_nan=False) + "\n")
        write_text(folder / FILES[3], _table(written))
        # Without a bar of its own: the bar is that of the whole.
        report.run(replace(job, output=folder / FILES[1], progress=lambda *_: None), [folder / FILES[0]])
    source = source_of(replace(job, output=own), written)
    page = Text(
        f"{job.output / FILES[1]}: all of it, with the picture; {new} of {len(told)} flights were new, the others kept."
    )
    paths = {told[role].flight: path for role, path in kept.items() if role in told}
    said, summary = (*answer(source), page), {**written.summary, "new": new}
    return Outcome(summary, said, exit_code(written.verdict), (_next(job, written, paths),))


def _expanded(given: Sequence[Path], output: Path) -> Iterator[Path]:
    """List flights and logs in place of folders that hold them, in the order of their names."""
    for path in given:
        if not path.is_dir():
            yield path
            continue
        inside = [own for own in path.rglob("*") if own.is_file() and not _is_apart(own, path, output)]
        known = sorted((own for own in inside if is_log(own) or format_name(own) == _FLIGHT), key=_natural)
        if not known:
            raise InputError(f"{path}: holds no flight and no log")
        yield from known


def _is_apart(path: Path, folder: Path, output: Path) -> bool:
    """Tell whether a file is hidden, or of the output."""
    hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
    return hidden or path.resolve().is_relative_to(output.resolve())


def _natural(path: Path) -> list[tuple[int, str]]:
    """Give what orders names as people do: log 2 before log 10."""
    return [(int(part), "") if part.isdigit() else (0, part) for part in re.split(r"([0-9]+)", str(path))]


@dataclass(frozen=True)
class Reading:
    """Tell the numbers of flights, given by their index, and keep them in a folder: work that can be shared out."""

    flights: tuple[Path, ...]
    files: tuple[InputFile, ...]
    study: Study
    folder: Path
    cautions: tuple[str, ...]

    def __call__(self, genes: IntArray) -> Evaluation:
        """Give 0 for each flight whose numbers are kept now, and 1 where it tells none."""
        refused = [self._refuses(int(index)) for index in genes[:, 0]]
        return Evaluation(genes, np.array(refused, dtype=float)[:, None])

    def _refuses(self, index: int) -> bool:
        try:
            kept_numbers(self.flights[index], self.files[index], self.study, self.folder, self.cautions)
        except _OF_A_LOG:
            return True
        return False


def _told(
    job: Job, given: Mapping[str, Path], inputs: Mapping[str, InputFile], options: Options
) -> tuple[dict[str, FlightNumbersRecord], int, list[str]]:
    """Give the numbers of all flights by role, of how many they were not kept, and why others are left out."""
    folder = job.output / FOLDER
    labels = dict(zip(given, unique_labels(list(given.values())), strict=True))
    known = {role: find_kept(path, inputs[role], job.study, folder) for role, path in given.items()}
    new = [role for role, record in known.items() if record is None]
    try:
        if len(new) > 1 and (options.workers > 1 or options.scheduler is not None):
            _share_out(job, {role: given[role] for role in new}, inputs, options)
        refused = []
        for index, role in enumerate(new):
            job.progress(index, len(new), labels[role])
            try:
                known[role] = kept_numbers(given[role], inputs[role], job.study, folder, job.cautions)
            except _OF_A_LOG as error:
                refused.append(error)
    except KeyboardInterrupt as interrupt:
        interrupt.add_note(f"what was read is kept in {folder}; the same command goes on from there")
        raise
    job.progress(len(new), len(new))
    told = {role: replace(record, flight=labels[role]) for role, record in known.items() if record is not None}
    if not told:
        raise refused[0]
    return told, len(new) - len(refused), _left_out(refused)


def _left_out(refused: Sequence[Exception]) -> list[str]:
    """Name flights that tell nothing, in one sentence: each says its own name and the first reason."""
    if not refused:
        return []
    first = [str(error).splitlines()[0] for error in refused]
    return [f"left out, {len(refused)} flight{'s' if len(refused) > 1 else ''}: {'; '.join(first)}"]


def _share_out(job: Job, given: Mapping[str, Path], inputs: Mapping[str, InputFile], options: Options) -> None:
    """Let workers tell and keep the numbers; why a flight tells none is found out afterwards."""
    reading = Reading(
        # Workers on a scheduler may have another folder than this process.
        tuple(Path(os.path.abspath(path)) for path in given.values()),
        tuple(inputs[role] for role in given),
        job.study,
        Path(os.path.abspath(job.output / FOLDER)),
        tuple(job.cautions),
    )
    done = 0
    with employ(reading, count=min(options.workers, len(given)), scheduler=options.scheduler) as workers:
        for rows, _ in workers.stream(np.arange(len(given))[:, None]):
            done += len(rows)
            job.progress(done, len(given))


def _record(job: Job, told: Mapping[str, FlightNumbersRecord], options: Options, notes: Sequence[str]) -> TrendRecord:
    ordered, order, about = _ordered(told, options.order)
    vehicle = job.study.vehicle
    apart = of_other_vehicles(stated_by(ordered), anyway=options.anyway)
    found = trend(
        [numbers_of_flight(own) for own in ordered], vehicle, generator(job.study, "trend"), options.reference
    )
    flown = {own.flight: own.flown_at for own in ordered}
    loads = any(name.startswith("load ") for name in found.names)
    unlike, ranges = of_other_autopilots(ordered, loads=loads)
    lacking = f"left out, for they do not tell {len(found.names)} numbers that most do: {', '.join(found.left_out)}"
    warnings = [
        *notes,
        *apart,
        *([lacking] if found.left_out else []),
        *about,
        *_of_commands(ordered),
        *(f"{own.flight}: {words}" for own in ordered for words in own.warning),
    ]
    return TrendRecord.of(
        found,
        [flown[flight.name] for flight in found.flights],
        order,
        units_of(found.names, vehicle),
        warnings,
        contradictions_of(ordered),
        false_alarm=FALSE_ALARM,
        named_from=NAMED,
        unlike=unlike,
        ranges=ranges,
    )


def _of_commands(flights: Sequence[FlightNumbersRecord]) -> Iterator[str]:
    if len({own.commanded for own in flights}) > 1:
        yield "some flights log speeds of rotors, others commands: loads are not compared; import one signal of all"
    without = [own.flight for own in flights if own.commanded and not np.isfinite(own.voltage)]
    if without:
        yield (
            f"without the battery's voltage: {len(without)} of {len(flights)} flights; an emptier battery looks like a "
            "heavier vehicle, so name import.signals.voltage"
        )


def _ordered(
    told: Mapping[str, FlightNumbersRecord], order: str | None
) -> tuple[list[FlightNumbersRecord], str, list[str]]:
    """Put flights in time order, and say by what, and which cannot be."""
    flights = list(told.values())
    undated = [own.flight for own in flights if not np.isfinite(own.flown_at)]
    if order == "given":
        return flights, order, []
    if order == "date" and undated:
        if len(undated) == len(flights):
            raise InputError("--order date: no log tells when it was flown; take --order name or given")
        notes = [f"left out, for their logs do not tell when they were flown: {', '.join(undated)}"]
        flights = [own for own in flights if own.flight not in undated]
        return sorted(flights, key=lambda own: own.flown_at), "date", notes
    if order != "name" and not undated:
        return sorted(flights, key=lambda own: own.flown_at), "date", []
    some = 0 < len(undated) < len(flights) and order is None
    notes = [f"{len(undated)} of {len(flights)} logs do not tell when they were flown, so names order them all"]
    return sorted(flights, key=lambda own: _natural(Path(own.flight))), "name", notes if some else []


def _table(record: TrendRecord) -> str:
    """Write one row a flight, one column a number, for other programs."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["flight", "flown_at", "reference", "part", *record.number])
    for row in record.rows:
        second = row["flown_at_s"]
        date = datetime.fromtimestamp(second, UTC).isoformat() if np.isfinite(second) else ""
        values = [f"{value:.9g}" for value in row["numbers"].values()]
        writer.writerow([row["flight"], date, int(row["reference"]), row["part"], *values])
    return text.getvalue()


def _next(job: Job, record: TrendRecord, paths: Mapping[str, Path]) -> Command:
    """Give the command that goes on: the last flights beside the reference, or all numbers."""
    if not len(record.shift.start):
        return "cpfls", "info", job.output / FILES[0], "-v"
    start = int(record.shift.start[-1])
    after = [paths[name] for name in record.flight[start:][-_COMPARED:]]
    before = [paths[name] for name in record.flight[: min(record.reference, start)][-_BEFORE:]]
    return go_on(job, "changed", *after, "--reference", *before, output=job.beside("changed"))
