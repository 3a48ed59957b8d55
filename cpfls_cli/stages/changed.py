"""Say what has changed about a vehicle since reference flights: a rotor, its weight, its battery, or nothing."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from cpfls_cli.arguments import OtherVehicleOption
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.changes.judge import changed as compared
from cpfls_cli.changes.numbers import FlightNumbers
from cpfls_cli.changes.reference import Reference
from cpfls_cli.changes.results import Changed
from cpfls_cli.errors import InputError
from cpfls_cli.flights.training import numbered_roles, once
from cpfls_cli.logs.formats import formats_in_words
from cpfls_cli.report.canvas import BASELINE, GREY, Drawn, Figure, legend_over
from cpfls_cli.report.source import unique_labels
from cpfls_cli.result import column
from cpfls_cli.stage import Filled, Run, stage
from cpfls_cli.stages._flight_numbers import (
    FOLDER,
    WORDS,
    contradictions_of,
    exit_code,
    first_of_each,
    kept_numbers,
    of_other_autopilots,
    of_other_vehicles,
    stated_by,
    stated_of,
    without_voltage,
)
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import joined

_NO_COLUMN = re.compile(r"import\.signals\.(?P<signal>\w+)\.columns: the log has no column '(?P<column>[^']+)'")
_RATE = 0.01  # By which sampling rates differ that are another.
_UNLIKE = 0.7
"""Share of what a number may be off by that is not known for how flights are flown, from which on it is said: a half of
the variance."""

_MARKERS = "osD^vP"  # Of today's flights; more look alike.
_LONG = 18  # Letters of a flight's name from which on names stand one below the other.
_ROW, _HEAD = 0.19, 0.8  # Inches of a picture for each number, and around them.
_REFERENCE: dict[str, Any] = {"color": GREY, "marker": "|", "markersize": 7, "linestyle": "none", "zorder": 2}
_TODAY: dict[str, Any] = {
    "color": "black",
    "linestyle": "none",
    "markersize": 4.5,
    "markerfacecolor": "none",
    "zorder": 3,
}
_BAND: dict[str, Any] = {"color": "#dddddd", "linewidth": 0.0, "zorder": 0.5}


def _height(r: Changed) -> float:
    today = len(r.today)
    return _HEAD + _ROW * (float(_places(r)[-1]) + 1 + (min(today, len(_MARKERS)) + 3) / _columns(r))


def _columns(r: Changed) -> int:
    return 1 if max(map(len, r.today)) > _LONG else 4


def _draw(r: Changed, figure: Figure) -> None:
    """Draw each number of today's flights over the band of the reference, in deviations."""
    axes, places = figure.subplots(), _places(r)
    today, before = (
        np.stack(
            [(values - own.reference) / own.deviation for own, values in zip(r.numbers, side, strict=True)], axis=1
        )
        for side in (column(r.numbers, "today"), column(r.numbers, "before"))
    )
    more = max(0, len(today) - len(_MARKERS))
    axes.axvspan(-2.0, 2.0, label="two deviations", **_BAND)
    axes.axvline(0.0, **BASELINE)
    axes.plot(before.ravel(), np.tile(places, len(before)), label="reference", **_REFERENCE)
    for marker, own, label in zip(_MARKERS, today, r.today, strict=False):
        axes.plot(own, places, marker=marker, label=label, **_TODAY)
    if more:
        axes.plot(today[-more:].ravel(), np.tile(places, more), marker="x", label=f"{more} more", **_TODAY)
    axes.set_yticks(places, column(r.numbers, "name"))
    axes.invert_yaxis()
    axes.set_xlabel("deviations from the reference")
    axes.grid(visible=False, axis="y")
    legend_over(figure, axes, _columns(r))


def _places(r: Changed) -> Array:
    """Give each number a row, and each kind some room before it."""
    kinds = [own.name.split()[0] for own in r.numbers]
    new = [0.0, *(0.6 * (one != other) for one, other in pairwise(kinds))]
    return np.asarray(np.arange(len(kinds)) + np.cumsum(new))


@stage(
    Changed,
    title="What changed",
    figures={"numbers": Drawn("Numbers of today's flights in deviations from the reference, by kind", _height, _draw)},
    words={**WORDS, "first_of_each": first_of_each, "first_word": lambda text: text.split()[0]},
    fills=Filled(kept=FOLDER),
    study=True,
    several=True,
)
def changed(
    run: Run,
    today: Annotated[
        list[Path],
        typer.Argument(metavar="TODAY", help=f"Flights, or logs ({formats_in_words()}), to look for a change in."),
    ],
    since: Annotated[
        list[Path],
        typer.Option(
            "--reference",
            "--since",
            metavar="FLIGHT",
            help="Flights or logs of the same vehicle from before, three or more, one after another.",
            show_default=False,
        ),
    ],
    fail_on_change: Annotated[
        bool,
        typer.Option(
            "--fail-on-change",
            help="End with exit code 1 where something has changed, for scripts; with two reference flights 0 "
            "says only that nothing is beyond what is usual of vehicles. Where that is unknown the exit code is 3, "
            "with or without this.",
        ),
    ] = False,
    anyway: OtherVehicleOption = False,
) -> Changed | None:
    """Hold flights of today against reference flights."""
    given = numbered_roles("today", today) | numbered_roles("since", since)
    inputs = run.take(given)
    kept, twice = once(given, inputs)
    if run.dry_run:
        return None
    flights, left_out = _flights(run, kept, inputs, anyway=anyway)
    other = of_other_vehicles(stated_by([flights[role] for role in sorted(flights)]), anyway=anyway)
    found = _compared(run, flights, [*left_out, *other, *twice])
    run.files = {role: inputs[role] for role in flights}
    run.exit_code = exit_code(found.verdict, fail_on_change=fail_on_change)
    if found.changed:
        flown = [kept[role] for role in flights]
        run.go_on("gap", *flown[found.since_flight : len(found.today)], output=run.sibling("gap"))
    else:
        run.next.append(("cpfls", "info", run.output / "changed.h5", "-v"))
    return found


def _flights(
    run: Run, given: Mapping[str, Path], inputs: Mapping[str, InputFile], *, anyway: bool
) -> tuple[dict[str, FlightNumbers], list[str]]:
    """Compute the numbers of all flights by role, under names of their own; one that has none is left out."""
    folder, labels = run.output / FOLDER, unique_labels(list(given.values()))
    flights: dict[str, FlightNumbers] = {}
    refused: dict[str, InputError] = {}
    for index, ((role, path), label) in enumerate(zip(given.items(), labels, strict=True)):
        run.progress(index, len(given), label)
        try:
            own = kept_numbers(path, inputs[role], run.study, folder, run.cautions)
            flights[role] = replace(own, name=label)
        except InputError as error:
            refused[role] = error
            if anyway:
                # Of another vehicle's log what it holds is compared.
                with suppress(InputError):
                    signals = {name: replace(own, required=False) for name, own in run.study.import_.signals.items()}
                    study = run.study.model_copy(update={"import_": replace(run.study.import_, signals=signals)})
                    own = kept_numbers(path, inputs[role], study, folder, run.cautions)
                    flights[role] = replace(own, name=label)
                    del refused[role]
    run.progress(len(given), len(given))
    if refused and not anyway:
        # Why a log is another vehicle's comes before what it lacks.
        by_role = dict(zip(given, labels, strict=True))
        stated = dict(stated_by(list(flights.values()))) | {by_role[role]: stated_of(given[role]) for role in refused}
        of_other_vehicles([(by_role[role], stated[by_role[role]]) for role in sorted(given)], anyway=anyway)
    for side in ("today", "since"):
        if not any(role.startswith(side) for role in flights):
            first = next(role for role in refused if role.startswith(side))
            raise InputError(_lacking(given[first], str(refused[first]), anyway=anyway))
    return flights, [f"left out: {error}" for error in refused.values()]


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


def _compared(run: Run, flights: Mapping[str, FlightNumbers], notes: Sequence[str]) -> Changed:
    """Hold flights of today against the others, and say what to know of them."""
    today, before = ([own for role, own in flights.items() if role.startswith(side)] for side in ("today", "since"))
    found = compared(today, before, run.study.vehicle, np.random.default_rng(run.study.seed))
    names = column(found.numbers, "name")
    thrusts = any(name.startswith("thrust ") for name in names)
    unlike, ranges = of_other_autopilots([*before, *today], thrusts=thrusts)
    warnings = [
        *notes,
        *_warnings(today, before, names),
        *flown_unlike(found, today, before, run.study.vehicle),
        *(f"{own.name}: {words}" for own in (*today, *before) for words in own.warnings),
    ]
    return replace(
        found,
        stated_otherwise=tuple(unlike),
        other_ranges=tuple(ranges),
        contradictions=tuple(contradictions_of([*today, *before])),
        warnings=tuple(warnings),
    )


def _warnings(today: Sequence[FlightNumbers], before: Sequence[FlightNumbers], names: Sequence[str]) -> Iterator[str]:
    """Say what the comparison lacks."""
    flights = [*before, *today]
    if len({own.commanded for own in flights}) > 1:
        speeds, commands = ([own.name for own in flights if own.commanded == of] for of in (False, True))
        yield (
            f"speeds of rotors in {joined(speeds)}, commands in {joined(commands)}: shares of thrust are not "
            "compared; import the same signal of all"
        )
    elif flights[0].commanded and not all(np.isfinite(own.voltage) for own in flights):
        without = [own.name for own in flights if not np.isfinite(own.voltage)]
        yield without_voltage("all flights" if len(without) == len(flights) else joined(without))
    usual = float(np.median([own.period_s for own in before]))
    other = [own for own in flights if abs(own.period_s / usual - 1) > _RATE]
    if other:
        listed = joined(f"{own.name} ({1 / own.period_s:.4g} Hz)" for own in other)
        yield (
            f"another sampling rate than the usual one of the reference, {1 / usual:.4g} Hz: {listed}; what vibrates "
            "faster than half the rate looks otherwise there"
        )
    lost = [name for name in dict.fromkeys(name for own in flights for name in own.values) if name not in names]
    if lost:
        by_flights: dict[str, list[str]] = {}
        for each in lost:
            by_flights.setdefault(joined(own.name for own in flights if each not in own.values), []).append(each)
        listed = "; ".join(f"{joined(each)} (not {without})" for without, each in by_flights.items())
        yield f"not compared, for not all flights have it: {listed}"


def flown_unlike(
    found: Changed, today: Sequence[FlightNumbers], before: Sequence[FlightNumbers], vehicle: VehicleSettings
) -> Iterator[str]:
    """Say that today's flights are flown unlike those of the reference, where that makes them say less."""
    names, deviation = column(found.numbers, "name"), np.array(column(found.numbers, "deviation"))
    reference = Reference.of(before, names, vehicle)
    without = [flight.name for flight in [*before, *today] if not np.isfinite(flight.agility)]
    if without:
        yield (
            f"without attitude: {joined(without) if len(without) < len(before) + len(today) else 'all flights'}; how "
            f"{'any flight' if not np.isfinite(reference.agility) else 'it'} is flown is not known, and another way of "
            "flying can look like a change; import the attitude, or fly alike"
        )
    unsure = np.abs(reference.more_agile(today)).max() * reference.agility_error
    kinds = dict.fromkeys(
        name.split()[0] for name, less in zip(names, unsure > _UNLIKE * deviation, strict=True) if less
    )
    if kinds:
        now, then = ([flight.agility for flight in side if np.isfinite(flight.agility)] for side in (today, before))
        yield (
            f"flown unlike the reference: with accelerations of {_range(now)} m/s^2 (root mean square), those of "
            f"{_range(then)}; {joined(kinds)} count for less, as they depend on it; take reference flights that are "
            "flown alike"
        )
    turned = reference.turned_more(today).mean(axis=0)
    if (np.abs(turned) > _UNLIKE * deviation).any():
        yaw = np.mean([flight.turning for flight in today])
        yield (
            f"turns unlike the reference: evenly, by {yaw:.2f} rad/s about z, where that turns by "
            f"{reference.turning:.2f} rad/s; a torque about z is uncertain, as turning takes one against the air; take "
            "flights that turn alike, or both ways"
        )


def _range(values: Sequence[float]) -> str:
    low, high = f"{min(values):.2g}", f"{max(values):.2g}"
    return low if low == high else f"{low} to {high}"
