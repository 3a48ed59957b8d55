"""The page of many flights in time: since when what is changed, and each number over the flights."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.trend import TrendRecord
from cpfls_cli.pages.changed import (
    MOST_MOVED,
    checks,
    first_of_each,
    most_moved,
    natural_unit,
    no_known_change,
    nothing_shows,
    other_autopilots,
    told,
    unchanged_within,
    would_have_shown,
)
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, GREY, band, in_columns, legend_over, plot
from cpfls_cli.report.content import Block, Box, Cell, Facts, Folded, Heading, Plot, Table, Text, in_short
from cpfls_cli.report.numbers import number, sentence
from cpfls_cli.vehicle.settings import VehicleSettings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ORDERS = {"date": "their dates", "name": "their names", "given": "the command line"}
_SHOWN = 5
"""Change points that a first screen has room for."""

_COLUMNS, _HEIGHT, _HEAD = 3, 1.35, 0.7
"""Of small multiples: side by side, inches of each, and beside them."""

_BAND: dict[str, Any] = {"color": "#dddddd"}
_FLIGHTS: dict[str, Any] = {"color": "black", "linestyle": "none", "markersize": 3.2, "marker": "o"}
_LIMIT: dict[str, Any] = {"color": GREY, "linestyle": (0, (1, 1.6)), "linewidth": 0.9}
_SINCE: dict[str, Any] = {"color": "black", "linestyle": (0, (5, 1.6)), "linewidth": 1.1}


def answer(trend: Source[TrendRecord], index: int = 1) -> Iterator[Block]:
    """Say since which flights what is changed, or that nothing is, and what of it to trust."""
    record, vehicle = trend.record, trend.vehicle
    yield from in_short(trend_box(record, vehicle), _SHOWN, "change points before")
    yield Facts(list(_facts(record, vehicle)))
    yield Folded("each change point and each flight", [*_tables(record, index)])
    # What is left out is told first, however much else there is.
    yield from (Text(words, "warning", always=at == 0) for at, words in enumerate(record.warning))


def trend_box(record: TrendRecord, vehicle: VehicleSettings) -> Box:
    """Say in a sentence for each change point what changed; the last comes first, for the vehicle flies as that."""
    wrong, other = first_of_each(record.contradiction), other_autopilots(record)
    if record.changed:
        first, *more = _what_changed(record, vehicle)
        return Box(record.verdict, first, [*more, *wrong, *other], "warning")
    over = f"over {len(record.flight)} flights, beyond what they differ by"
    if wrong:
        return Box(record.verdict, wrong[0], [*wrong[1:], f"Nothing changed {over}, which says little then."], "unsure")
    if record.ranges:
        return Box(record.verdict, other[-1], [*other[:-1], f"Nothing changed {over}."], "unsure")
    if not record.has_size:
        return Box(record.verdict, nothing_shows(record), other, "unsure")
    return Box(record.verdict, f"{over}; in one flight {unchanged_within(record, vehicle)}", other, "good")


def _what_changed(record: TrendRecord, vehicle: VehicleSettings) -> Iterator[str]:
    """Say each change point, the last first, and single flights that are off by themselves."""
    yield from (f"{each}, as in no flight of the reference" for each in record.reversed)
    yield from (_since(record, shift, vehicle) for shift in reversed(range(len(record.shift.start))))
    for index in np.flatnonzero(record.beyond.any(axis=1)) if not len(record.shift.start) else ():
        moved = no_known_change(record.number, record.apart[index] / record.deviation[index])
        yield f"In {_flight(record, int(index))} alone: {moved[:1].lower()}{moved[1:]}"


def _since(record: TrendRecord, shift: int, vehicle: VehicleSettings) -> str:
    start = int(record.shift.start[shift])
    causes = record.causes(shift)
    what = " And: ".join(sentence(told(record, index, vehicle)) for index in causes) or no_known_change(
        record.number, record.moved(shift)
    )
    return f"Since {_flight(record, start)}: {what[:1].lower()}{what[1:]}"


def _flight(record: TrendRecord, index: int) -> str:
    date = _date(record.flown_at[index])
    return f"{record.flight[index]} ({date + ', ' if date else ''}flight {index + 1} of {len(record.flight)})"


def _date(second: float) -> str:
    return datetime.fromtimestamp(second, UTC).strftime("%Y-%m-%d") if np.isfinite(second) else ""


def _facts(record: TrendRecord, vehicle: VehicleSettings) -> Iterator[tuple[str, str]]:
    dates = [_date(second) for second in record.flown_at[[0, -1]]]
    span = f", {dates[0]} to {dates[1]}" if record.order == "date" else ""
    yield (
        "Flights",
        f"{len(record.flight)} in the order of {_ORDERS.get(record.order, record.order)}{span}; the first "
        f"{record.reference} are the reference.",
    )
    beyond = [row["flight"] for row in record.rows if row["beyond"]]
    rest = f" and {len(beyond) - MOST_MOVED} more" if len(beyond) > MOST_MOVED else ""
    yield "Beyond limits", sentence(f"{', '.join(beyond[:MOST_MOVED])}{rest}" if beyond else "no flight")
    if len(record.shift.start):
        # Of the last change point that tells of something: the vehicle flies as that.
        yield from checks(record, [] if not len(record.shifts) else record.causes(int(record.shifts.max())))
    else:
        yield (
            "Would have shown",
            sentence(", ".join(would_have_shown(record, vehicle)) or "nothing that is looked for in one flight"),
        )
    yield (
        "Chance",
        sentence(f"as many flights of an unchanged vehicle look like this with p = {number(record.p_value, 1)}"),
    )


def _tables(record: TrendRecord, index: int) -> Iterator[Table]:
    if len(record.shift.start):
        rows = [
            [
                record.flight[start],
                _date(record.flown_at[start]),
                str(start + 1),
                "; ".join(record.found.cause[at] for at in record.causes(shift)),
                most_moved(record.number, record.moved(shift)),
            ]
            for shift, start in enumerate(record.shift.start.tolist())
        ]
        header = ("Since", "Date", "Flight", "What", "Numbers that move most")
        caption = "Change points, each beside the flights before it."
        yield Table(f"trend-shifts-{index}", caption, header, rows, frozenset({0, 1, 3, 4}), frozenset({4}))
    flights: list[list[str | Cell]] = []
    for at, (row, apart) in enumerate(zip(record.rows, record.apart / record.deviation, strict=True)):
        most = int(np.argmax(np.abs(apart)))
        furthest = f"{record.number[most]} {apart[most]:+.1f}"
        flights.append(
            [
                row["flight"],
                _date(record.flown_at[at]),
                "reference" if row["reference"] else "",
                str(row["part"]),
                Cell(furthest, "warning" if row["beyond"] else "plain"),
            ]
        )
    yield Table(
        f"trend-flights-{index}",
        "All flights in their order.",
        ("Flight", "Date", "Is", "Part", "Furthest number"),
        flights,
        frozenset({0, 1, 2, 4}),
        legend="Part: between change points; furthest number: in deviations from the reference, marked beyond its "
        f"limit of {number(record.limit, 2)} deviations.",
    )


def trend_blocks(trend: Source[TrendRecord], index: int) -> Iterator[Block]:
    """Show a trend on a page: the answer, each number over the flights, and all flights."""
    record, vehicle = trend.record, trend.vehicle
    yield Heading(trend.label)
    yield trend_box(record, vehicle)
    yield Facts(list(_facts(record, vehicle)))
    yield trend_figure(f"trend-{index}", record)
    yield from _tables(record, index)
    yield from (Text(words, "warning") for words in record.warning)


def trend_figure(name: str, record: TrendRecord) -> Plot:
    """Draw each number over the flights, with its band, its limits and the change points."""
    flights = np.arange(1, len(record.flight) + 1, dtype=float)
    first = np.arange(len(flights)) < record.reference

    def draw(figure: Figure) -> None:
        panels = in_columns(figure, len(record.number), _COLUMNS)
        for axes, at in zip(panels.flat, range(len(record.number)), strict=False):
            values, turned = _turned(record, at)
            band(axes, flights, turned[0], turned[1], label="two deviations", **_BAND)
            axes.axhline(0.0 if natural_unit(record.number[at]) is not None else record.mean[at], **BASELINE)
            for side, label in ((2, "limits"), (3, "")):
                axes.plot(flights, turned[side], label=label, **_LIMIT)
            axes.plot(flights[first], values[first], markerfacecolor="white", label="reference", **_FLIGHTS)
            axes.plot(flights[~first], values[~first], label="flights", **_FLIGHTS)
            for shift, start in enumerate(record.shift.start.tolist()):
                axes.axvline(start + 0.5, label="" if shift else "change point", **_SINCE)
            axes.set_title(f"{record.number[at]}{_unit(record, at)}")
            # Limits that are far off would leave all else flat.
            shown = np.concatenate([values, *turned[:2]])
            margin = 0.08 * float(np.ptp(shown)) or 1.0
            axes.set_ylim(float(shown.min()) - margin, float(shown.max()) + margin)
        for axes in panels[-1]:
            axes.set_xlabel("flight")
        legend_over(figure, panels.flat[0], 5)

    caption = (
        "Each number over the flights: grey the two deviations in which nearly all flights lie where nothing changed, "
        "dotted the limits that none of them passes, hollow the reference, dashed upright the change points. "
        "In percent beside the reference where it is a logarithm."
    )
    height = _HEAD + _HEIGHT * int(np.ceil(len(record.number) / _COLUMNS))
    return plot(name, caption, "Each number of the vehicle over its flights", height, draw)


def _unit(record: TrendRecord, at: int) -> str:
    if natural_unit(record.number[at]) is not None:
        return ", %"
    return "" if record.unit[at] == "1" else f", {record.unit[at]}"


def _turned(record: TrendRecord, at: int) -> tuple[Array, list[Array]]:
    """Give a number of all flights, and the ends of its band and its limits, in the unit in which it is drawn."""
    apart, deviation = record.apart[:, at], record.deviation[:, at]
    ends = [factor * deviation for factor in (-2.0, 2.0, -record.limit, record.limit)]
    if natural_unit(record.number[at]) is not None:
        return 100 * np.expm1(apart), [100 * np.expm1(end) for end in ends]
    return record.mean[at] + apart, [record.mean[at] + end for end in ends]
