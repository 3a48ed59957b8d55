"""Say since which of many flights what is changed about a vehicle; a second call reads only new ones."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from cpfls_cli.arguments import OtherVehicleOption, SchedulerOption, TimeOrder
from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.gate import InputFile, format_name
from cpfls_cli.changes.numbers import FlightNumbers
from cpfls_cli.changes.results import NumberInTime, Trend
from cpfls_cli.changes.trend import load_ruptures
from cpfls_cli.changes.trend import trend as over_flights
from cpfls_cli.config.study import Study, generator
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.flights.training import numbered_roles, once
from cpfls_cli.logs.formats import formats_in_words, is_log
from cpfls_cli.report.canvas import BASELINE, GREY, Drawn, Figure, band, in_columns, legend_over
from cpfls_cli.report.source import unique_labels
from cpfls_cli.result import column
from cpfls_cli.stage import Filled, Run, stage
from cpfls_cli.stages._flight_numbers import (
    FOLDER,
    WORDS,
    contradictions_of,
    exit_code,
    find_kept,
    first_of_each,
    kept_numbers,
    natural_unit,
    of_other_autopilots,
    of_other_vehicles,
    stated_by,
    without_voltage,
)
from cpfls_cli.workers.workforce import employ

_FLIGHT = "cpfls/flight"
_COMPARED, _BEFORE = 3, 5
"""Flights that the command to go on with names: the last ones, and of the reference."""

_OF_A_LOG = (InputError, ComputationError)
"""Why a log is left out, where another is not."""

_COLUMNS, _HEIGHT, _HEAD = 3, 1.35, 0.7
"""Of small multiples: side by side, inches of each, and around them."""

_BAND: dict[str, Any] = {"color": "#dddddd"}
_FLIGHTS: dict[str, Any] = {"color": "black", "linestyle": "none", "markersize": 3.2, "marker": "o"}
_LIMIT: dict[str, Any] = {"color": GREY, "linestyle": (0, (1, 1.6)), "linewidth": 0.9}
_SINCE: dict[str, Any] = {"color": "black", "linestyle": (0, (5, 1.6)), "linewidth": 1.1}


def _draw(r: Trend, figure: Figure) -> None:
    """Draw each number over the flights, with its band, its limits and the change points."""
    flights, first = np.arange(1, len(r.flights) + 1, dtype=float), np.array(column(r.flights, "reference"))
    panels = in_columns(figure, len(r.numbers), _COLUMNS)
    for axes, own in zip(panels.flat, r.numbers, strict=False):
        values, ends = _turned(own)
        natural = natural_unit(own.name) is not None
        band(axes, flights, ends[0], ends[1], label="two deviations", **_BAND)
        axes.axhline(0.0 if natural else own.reference, **BASELINE)
        for side, label in ((2, "limits"), (3, "")):
            axes.plot(flights, ends[side], label=label, **_LIMIT)
        axes.plot(flights[first], values[first], markerfacecolor="white", label="reference", **_FLIGHTS)
        axes.plot(flights[~first], values[~first], label="flights", **_FLIGHTS)
        for at, shift in enumerate(r.shifts):
            axes.axvline(shift.flight - 0.5, label="" if at else "change point", **_SINCE)
        axes.set_title(f"{own.name}{', %' if natural else '' if own.unit == '1' else f', {own.unit}'}")
        # Limits that are far off would leave all else flat.
        shown = np.concatenate([values, *ends[:2]])
        margin = 0.08 * float(np.ptp(shown)) or 1.0
        axes.set_ylim(float(shown.min()) - margin, float(shown.max()) + margin)
    for axes in panels[-1]:
        axes.set_xlabel("flight")
    legend_over(figure, panels.flat[0], 5)


def _turned(own: NumberInTime) -> tuple[Array, list[Array]]:
    """Give a number of all flights, and the ends of its band and its limits, in the unit in which it is drawn."""
    apart = own.values - own.reference
    ends = [factor * own.deviation for factor in (-2.0, 2.0, -own.limit, own.limit)]
    if natural_unit(own.name) is not None:
        return 100 * np.expm1(apart), [100 * np.expm1(end) for end in ends]
    return own.values, [own.reference + end for end in ends]


def _date(second: float) -> str:
    return datetime.fromtimestamp(second, UTC).strftime("%Y-%m-%d") if np.isfinite(second) else ""


def _table(r: Trend) -> str:
    """Write one row a flight, one column a number, for other programs."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["flight", "flown_at", "reference", "part", *column(r.numbers, "name")])
    for at, own in enumerate(r.flights):
        date = datetime.fromtimestamp(own.flown_at_s, UTC).isoformat() if np.isfinite(own.flown_at_s) else ""
        values = [f"{number.values[at]:.9g}" for number in r.numbers]
        writer.writerow([own.flight, date, int(own.reference), own.part, *values])
    return text.getvalue()


@stage(
    Trend,
    title="What changed over many flights",
    figures={
        "numbers": Drawn(
            "Each number of the vehicle over its flights",
            lambda r: _HEAD + _HEIGHT * int(np.ceil(len(r.numbers) / _COLUMNS)),
            _draw,
        )
    },
    words={**WORDS, "first_of_each": first_of_each, "date": _date},
    fills=Filled(texts={"trend.csv": _table}, kept=FOLDER, grows=True),
    study=True,
)
def trend(
    run: Run,
    flights: Annotated[
        list[Path],
        typer.Argument(
            metavar="FLIGHT", help=f"Flights, logs ({formats_in_words()}), or folders that hold them, in any order."
        ),
    ],
    reference: Annotated[
        int | None,
        typer.Option(
            "--reference",
            metavar="N",
            min=1,
            help="The first N flights are those of the unchanged vehicle; default: half of them, as far as they do not "
            "change, and three at least.",
        ),
    ] = None,
    order: Annotated[
        TimeOrder | None,
        typer.Option("--order", help="What orders flights; default: their dates where all logs have one, or names."),
    ] = None,
    anyway: OtherVehicleOption = False,
    workers: Annotated[int, typer.Option("--workers", metavar="N", min=1, help="Processes that read logs.")] = 1,
    scheduler: SchedulerOption = None,
) -> Trend | None:
    """Hold the flights of a vehicle against each other in time."""
    # Before logs are read, which takes long.
    load_ruptures()
    given = numbered_roles("flight", list(_expanded(flights, run.output)))
    inputs = run.take(given)
    kept, twice = once(given, inputs)
    if run.dry_run:
        return None
    numbers, new, left_out = _numbers(run, kept, inputs, workers, scheduler)
    found = _trend(run, numbers, reference, order and order.value, [*left_out, *twice], anyway=anyway)
    run.files = {role: inputs[role] for role in numbers}
    run.exit_code = exit_code(found.verdict)
    run.also["new"] = new
    kept_before = ", the others kept" if new < len(numbers) else ""
    run.last_words = f"; {new} of {len(numbers)} flights were new{kept_before}."
    _go_on(run, found, {numbers[role].name: path for role, path in kept.items() if role in numbers})
    return found


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
    """Compute numbers of flights, given by their index, and keep them in a folder: work that can be shared out."""

    flights: tuple[Path, ...]
    files: tuple[InputFile, ...]
    study: Study
    folder: Path
    cautions: tuple[str, ...]

    def __call__(self, genes: IntArray) -> Evaluation:
        """Give 0 for each flight whose numbers are kept now, and 1 where it has none."""
        refused = [self._refuses(int(index)) for index in genes[:, 0]]
        return Evaluation(genes, np.array(refused, dtype=float)[:, None])

    def _refuses(self, index: int) -> bool:
        try:
            kept_numbers(self.flights[index], self.files[index], self.study, self.folder, self.cautions)
        except _OF_A_LOG:
            return True
        return False


def _numbers(
    run: Run, given: Mapping[str, Path], inputs: Mapping[str, InputFile], workers: int, scheduler: str | None
) -> tuple[dict[str, FlightNumbers], int, list[str]]:
    """Give the numbers of all flights by role, how many of them are new, and why others are left out."""
    folder = run.output / FOLDER
    labels = dict(zip(given, unique_labels(list(given.values())), strict=True))
    known = {role: find_kept(path, inputs[role], run.study, folder) for role, path in given.items()}
    new = [role for role, own in known.items() if own is None]
    try:
        if len(new) > 1 and (workers > 1 or scheduler is not None):
            _share_out(run, {role: given[role] for role in new}, inputs, workers, scheduler)
        refused = []
        for index, role in enumerate(new):
            run.progress(index, len(new), labels[role])
            try:
                known[role] = kept_numbers(given[role], inputs[role], run.study, folder, run.cautions)
            except _OF_A_LOG as error:
                refused.append(error)
    except KeyboardInterrupt as interrupt:
        interrupt.add_note(f"what was read is kept in {folder}; the same command goes on from there")
        raise
    run.progress(len(new), len(new))
    numbers = {role: replace(own, name=labels[role]) for role, own in known.items() if own is not None}
    if not numbers:
        raise refused[0]
    return numbers, len(new) - len(refused), _left_out(refused)


def _left_out(refused: Sequence[Exception]) -> list[str]:
    """Name flights that are left out, in one sentence: each says its own name and the first reason."""
    if not refused:
        return []
    first = [str(error).splitlines()[0] for error in refused]
    return [f"left out, {len(refused)} flight{'s' if len(refused) > 1 else ''}: {'; '.join(first)}"]


def _share_out(
    run: Run, given: Mapping[str, Path], inputs: Mapping[str, InputFile], workers: int, scheduler: str | None
) -> None:
    """Let workers compute and keep the numbers; why a flight has none is found out afterwards."""
    reading = Reading(
        # Workers on a scheduler may have another folder than this process.
        tuple(Path(os.path.abspath(path)) for path in given.values()),
        tuple(inputs[role] for role in given),
        run.study,
        Path(os.path.abspath(run.output / FOLDER)),
        tuple(run.cautions),
    )
    done = 0
    with employ(reading, count=min(workers, len(given)), scheduler=scheduler) as employed:
        for rows, _ in employed.stream(np.arange(len(given))[:, None]):
            done += len(rows)
            run.progress(done, len(given))


def _trend(
    run: Run,
    numbers: Mapping[str, FlightNumbers],
    reference: int | None,
    order: str | None,
    notes: Sequence[str],
    *,
    anyway: bool,
) -> Trend:
    """Hold flights against each other in their order, and say what to know of them."""
    ordered, by, about = _ordered(numbers, order)
    apart = of_other_vehicles(stated_by(ordered), anyway=anyway)
    found = over_flights(ordered, run.study.vehicle, generator(run.study, "trend"), reference)
    unlike, ranges = of_other_autopilots(
        ordered, thrusts=any(each.name.startswith("thrust ") for each in found.numbers)
    )
    lacking = (
        f"left out, for they lack some of {len(found.numbers)} numbers that most have: {', '.join(found.left_out)}"
    )
    warnings = [
        *notes,
        *apart,
        *([lacking] if found.left_out else []),
        *about,
        *_of_commands(ordered),
        *(f"{own.name}: {words}" for own in ordered for words in own.warnings),
    ]
    return replace(
        found,
        order=by,
        stated_otherwise=tuple(unlike),
        other_ranges=tuple(ranges),
        contradictions=tuple(contradictions_of(ordered)),
        warnings=tuple(warnings),
    )


def _of_commands(flights: Sequence[FlightNumbers]) -> Iterator[str]:
    if len({own.commanded for own in flights}) > 1:
        yield "some log rotor speeds, others commands: shares of thrust are not compared; import one signal of all"
    without = [own.name for own in flights if own.commanded and not np.isfinite(own.voltage)]
    if without:
        yield without_voltage(f"{len(without)} of {len(flights)} flights")


def _ordered(numbers: Mapping[str, FlightNumbers], order: str | None) -> tuple[list[FlightNumbers], str, list[str]]:
    """Put flights in time order, and say by what, and which cannot be."""
    flights = list(numbers.values())
    undated = [own.name for own in flights if not np.isfinite(own.flown_at_s)]
    if order == "given":
        return flights, order, []
    if order == "date" and undated:
        if len(undated) == len(flights):
            raise InputError("--order date: no log says when it was flown; take --order name or given")
        notes = [f"left out, for their logs do not say when they were flown: {', '.join(undated)}"]
        flights = [own for own in flights if own.name not in undated]
        return sorted(flights, key=lambda own: own.flown_at_s), "date", notes
    if order != "name" and not undated:
        return sorted(flights, key=lambda own: own.flown_at_s), "date", []
    some = 0 < len(undated) < len(flights) and order is None
    notes = [f"{len(undated)} of {len(flights)} logs do not say when they were flown, so names order them all"]
    return sorted(flights, key=lambda own: _natural(Path(own.name))), "name", notes if some else []


def _go_on(run: Run, found: Trend, paths: Mapping[str, Path]) -> None:
    """Name the command that goes on: the last flights against the reference, or all numbers."""
    if not found.shifts:
        run.next.append(("cpfls", "info", run.output / "trend.h5", "-v"))
        return
    names, start = column(found.flights, "flight"), found.shifts[-1].flight - 1
    after = [paths[name] for name in names[start:][-_COMPARED:]]
    before = [paths[name] for name in names[: min(len(found.reference_flights), start)][-_BEFORE:]]
    run.go_on("changed", *after, "--reference", *before, output=run.sibling("changed"))
