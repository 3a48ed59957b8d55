"""The page of what has changed about a vehicle: the answer, what would look alike, and each number in a picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.changed import ChangedRecord, FoundRecord
from cpfls_cli.pages.change_words import (
    cause_name,
    change_words,
    hover_words,
    number_meanings,
    smallest_words,
    what_to_check,
)
from cpfls_cli.pages.sensors import contradicted
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, GREY, legend_over, plot
from cpfls_cli.report.content import Block, Box, Cell, Facts, Folded, Heading, Plot, Table, Text
from cpfls_cli.report.numbers import number, sentence, whole_percent
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_OF_ALL = {"mass", "hover"}
"""Causes that hover tells first, and nothing tells apart."""

_NATURAL = {
    "load": "",
    "turn": "",
    "vibration gyroscope": "rad/s",
    "vibration accelerometer": "m/s²",
    "unbalance": "m/s²",
    "follow": "",
    "scale": "",
    "gusts": "rad/s²",
}
"""Units of numbers that are logarithms, without their axis: of what they are the logarithm of."""

_UNITS = {"m/s^2": "m/s²", "1": ""}
_SHOWN_FIRST = ("rotor M1", "mass", "centre of mass", "vibration", "late", "gusts")
"""Of what would have shown, as much as a first screen has room for; of rotors the one that shows least."""

LEFT_OUT = "left out: "
"""What begins the reason for which a flight is not compared."""

_OTHERS = 3
"""Of what would have shown, where nothing of that does."""

_ALIKE = 3
"""Others that are told beside a change that is not sure."""

_WITHIN = 2
"""Sizes that a verdict names."""

MOST_MOVED = 3
"""Numbers that are told where no change is known that does this."""

_CHECKED = 2
_WITH_MORE = {"rotor": ", perhaps with another", "hover": ", perhaps off the centre", "centre": ", perhaps by a mass"}
"""By the first word of a change: what may come with it."""

_SUREST = 0.999
_MARKERS = "osD^vP"
"""Of today's flights; more look alike."""

_LONG = 18
"""Letters of a flight's name from which on names stand one below the other."""

_ROW, _HEAD = 0.19, 0.8
"""Inches of a picture for each number, and beside them."""

_REFERENCE: dict[str, Any] = {"color": GREY, "marker": "|", "markersize": 7, "linestyle": "none", "zorder": 2}
_TODAY: dict[str, Any] = {
    "color": "black",
    "linestyle": "none",
    "markersize": 4.5,
    "markerfacecolor": "none",
    "zorder": 3,
}
_BAND: dict[str, Any] = {"color": "#dddddd", "linewidth": 0.0, "zorder": 0.5}


def answer(changed: Source[ChangedRecord], index: int = 1) -> Iterator[Block]:
    """Say whether the vehicle changed: what, by how much, how sure, since when, what looks alike, what to check."""
    record, vehicle = changed.record, changed.vehicle
    yield changed_box(record, vehicle)
    yield Facts(list(_facts(record, vehicle)))
    yield Folded("each number beside the reference, and what would have shown", [*_tables(record, vehicle, index)])
    # A flight that is not there changes the answer.
    yield from (Text(words, "warning", always=words.startswith(LEFT_OUT)) for words in record.warning)


def changed_box(record: ChangedRecord, vehicle: VehicleSettings) -> Box:
    """Say in a sentence what changed, or that nothing did and what would have shown, or why neither can be said."""
    wrong = first_of_each(record.contradiction)
    lacks = [*([_lost(record)] if record.lost else []), *([_assumed(record)] if record.short_of else [])]
    lacks += other_autopilots(record)
    if record.changed:
        first, *more = _what_changed(record, vehicle)
        also = [f"And: {each[:1].lower()}{each[1:]}" for each in more]
        return Box(record.verdict, first, [*wrong, *also, *lacks], "warning")
    beyond = "what is usual of vehicles" if record.short_of else "what flights of this vehicle differ by"
    if wrong:
        said = f"Nothing is beyond {beyond}, which says little of such a log."
        return Box(record.verdict, wrong[0], [*wrong[1:], said, *lacks], "unsure")
    if record.undetermined:
        return Box(record.verdict, _undetermined(record), lacks, "unsure")
    if not record.has_size:
        differ = f", as loads differ by up to {whole_percent(record.loads_differ)} within the reference"
        return Box(record.verdict, nothing_shows(record, differ if record.loads_differ > 0 else ""), lacks, "unsure")
    within = f"nothing beyond {beyond}; {unchanged_within(record, vehicle)}"
    return Box(record.verdict, within, lacks, "good" if record.verdict == "NO CHANGE" else "warning")


def nothing_shows(record: FoundRecord, because: str = "") -> str:
    """Say what would not have shown, so that it cannot be told whether anything changed."""
    what = "no change" if record.loads_show else "no weak rotor, mass or centre of mass"
    return (
        f"{what} of any size that is looked for would have shown{because}; give more reference flights, of other days, "
        "flown as today's are"
    )


def other_autopilots(record: FoundRecord) -> list[str]:
    """Say where logs state another board, version or range of outputs, as one vehicle can have in turn."""
    first = [sentence(f"{record.unlike[0]}: make sure that it is one vehicle")] if record.unlike else []
    scaled = f"Commands of {joined(record.ranges)} are shares of another range: loads may differ by that alone."
    return [*first, *([scaled] if record.ranges else [])]


def first_of_each(contradictions: Sequence[str]) -> list[str]:
    """Say of each flight that contradicts itself what comes first."""
    return [contradicted(each) for each in {own.partition(": ")[0]: own for own in reversed(contradictions)}.values()]


def _undetermined(record: ChangedRecord) -> str:
    """Say which ratios may be anything today."""
    return (
        f"{joined(record.undetermined)} may be zero or reversed today, and {_IS_REVERSED}; the other numbers are "
        "within their limits"
    )


_IS_REVERSED = (
    "in no reference flight: a gyroscope that is mirrored or dead, rotors that are exchanged, "
    "or a log that is read wrongly"
)


def unchanged_within(record: FoundRecord, vehicle: VehicleSettings) -> str:
    """Say below which sizes a change would not have shown, of the first that are looked for."""
    return f"unchanged within these sizes: {', '.join(list(would_have_shown(record, vehicle))[:_WITHIN])}"


def _what_changed(record: ChangedRecord, vehicle: VehicleSettings) -> Iterator[str]:
    """Say each change that was found, or else which numbers are off; and which are turned round."""
    if record.reversed:
        yield sentence(
            f"{joined(record.reversed)} {'is' if len(record.reversed) == 1 else 'are'} reversed, or nothing, and "
            f"{_IS_REVERSED}"
        )
    yield from (sentence(told(record, index, vehicle)) for index in range(len(record.found.cause)))
    if not record.found.cause and (record.p_value <= record.false_alarm or record.beyond.any()):
        yield no_known_change(record.number, record.furthest)


def no_known_change(names: Sequence[str], deviations: Array) -> str:
    """Say that flights differ, in which numbers most, and that no known change explains it."""
    return sentence(f"more than chance, but no change that is known explains it: {most_moved(names, deviations)}")


def most_moved(names: Sequence[str], deviations: Array) -> str:
    """List the numbers that differ most, in deviations."""
    most = np.argsort(-np.abs(deviations), kind="stable")[:MOST_MOVED]
    return f"{joined(f'{names[at]} by {deviations[at]:+.1f}' for at in most)} deviations"


def _lost(record: ChangedRecord) -> str:
    """Say what today's flights do not determine."""
    return (
        f"Not compared, for every reference flight determines it and today's do not: {joined(record.lost)}; if the log "
        "holds these channels, look whether a sensor or a rotor is dead or turned round."
    )


def _assumed(record: ChangedRecord) -> str:
    """Say that what flights differ by is assumed."""
    few, more = len(record.before), record.short_of
    return (
        f"It is held against what is usual, and not against what your own flights differ by, which {few} reference "
        f"flight{'s' if few > 1 else ''} cannot tell; give {more} more, of other days."
    )


def told(record: FoundRecord, index: int, vehicle: VehicleSettings) -> str:
    """Say what a change is, by how much and how sure, or which ones it may be."""
    cause, others = record.found.cause[index], record.others(index)
    axes = [name.split()[-1] for name in record.number if name.split()[0] == cause]
    what = change_words(cause, record.sizes(index), vehicle, axes, record.cable_length)
    sure = f"sure to {whole_percent(min(float(record.found.belief[index]), _SUREST))}"
    if record.named[index]:
        more = any(is_within(cause, name) for name, _ in others)
        return f"{what}{_WITH_MORE[cause.split()[0]] if more else ''}; {sure}"
    alike = [f"{cause_name(name)}, {whole_percent(belief)}" for name, belief in others[:_ALIKE]]
    return f"one of: {'; or '.join([f'{what}, {sure}', *alike])}"


def is_within(cause: str, other: str) -> bool:
    """Tell whether a pair of rotors holds the one that changed, or a mass what it does."""
    of_pair = cause.startswith("rotor ") and other.startswith("rotors ") and cause.split()[-1] in other.split()
    return of_pair or (cause in ("hover", "centre of mass") and other == "mass")


def _facts(record: ChangedRecord, vehicle: VehicleSettings) -> Iterator[tuple[str, str]]:
    listed = {*record.found.cause, *record.alike.cause}
    if record.hover_changed and record.changed and "hover" not in record.found.cause:
        share = float(np.expm1(record.hover))
        yield "Hover", sentence(hover_words(vehicle, share, alone=bool(listed & _OF_ALL)))
    if record.changed:
        yield "Since", sentence(_since(record))
        for index, cause in enumerate(record.found.cause):
            alike = [name for name, _ in record.others(index) if not is_within(cause, name)]
            if alike and record.named[index]:
                yield "Looks alike", sentence(joined(map(cause_name, alike)))
        yield from checks(record)
    else:
        yield (
            "Would have shown",
            sentence(", ".join(would_have_shown(record, vehicle)) or "nothing that is looked for"),
        )
        kinds = joined(dict.fromkeys(name.split()[0] for name in record.number))
        of = "; loads are of commands" if record.commanded else "; loads are of measured speeds"
        yield "Compared", sentence(f"{kinds}{of if 'load' in kinds else ''}")
    yield "Chance", sentence(_chance(record))


def _since(record: ChangedRecord) -> str:
    if len(record.today) == 1:
        return record.today[0]
    alone = [name for name, p in zip(record.today, record.by_flight, strict=True) if p <= record.false_alarm]
    shown = f"{len(alone)} of {len(record.today)} flights show it alone"
    first = record.today[record.since_flight]
    if record.since_flight == 0:
        return f"{first}, the first of today: {shown}"
    return f"{first}, number {record.since_flight + 1} of {len(record.today)}: {shown}"


def checks(record: FoundRecord, among: Sequence[int] | None = None) -> Iterator[tuple[str, str]]:
    """Say what to look at by hand, for all changes that were found or some of them."""
    looked: dict[str, str] = {}
    for index in range(len(record.found.cause)) if among is None else among:
        cause = record.found.cause[index]
        for name in [cause, *(() if record.named[index] else (name for name, _ in record.others(index)))]:
            looked.setdefault(what_to_check(name), cause_name(name))
    for check, name in list(looked.items())[:_CHECKED]:
        yield "Check", sentence(check if len(looked) == 1 else f"{name}: {check}")


def _chance(record: ChangedRecord) -> str:
    today, before = len(record.today), len(record.before)
    of_others = "in the other numbers " if record.reversed else ""
    return (
        f"{of_others}an unchanged vehicle looks like this with p = {number(record.p_value, 1)}; {today} "
        f"flight{'s' if today > 1 else ''} of today beside {before} of the reference"
    )


def would_have_shown(record: FoundRecord, vehicle: VehicleSettings) -> Iterator[str]:
    """Say how large changes are that would have shown."""
    smallest = dict(zip(record.shows.cause, record.shows.smallest.tolist(), strict=True))
    rotors = [size for name, size in smallest.items() if name.startswith("rotor ")]
    smallest["rotor M1"] = max(rotors, default=np.nan)
    listed = [name for name in _SHOWN_FIRST if np.isfinite(smallest.get(name, np.nan))]
    others = [name for name, size in smallest.items() if np.isfinite(size)][:_OTHERS]
    yield from (smallest_words(name, smallest[name], vehicle) for name in listed or others)


def _tables(record: ChangedRecord, vehicle: VehicleSettings, index: int) -> Iterator[Table]:
    rows: list[list[str | Cell]] = []
    for at, name in enumerate(record.number):
        usual, today = float(record.mean[at]), float(record.mean[at] + record.apart[:, at].mean())
        deviation, apart = float(record.deviation[at]), float(record.furthest[at])
        natural = natural_unit(name)
        if natural is None:
            told = [_UNITS.get(record.unit[at], record.unit[at]), *(number(each, 3) for each in (usual, today))]
            told.append(number(deviation, 2))
        else:
            told = [natural, *(number(float(np.exp(each)), 3) for each in (usual, today))]
            told.append(f"{number(100 * float(np.expm1(deviation)), 2)} %")
        limit = "—" if record.limit is None else number(float(record.limit[at]), 2)
        rows.append([name, *told, Cell(number(apart, 2), "warning" if record.beyond[at] else "plain"), limit])
    header = ("Number", "Unit", "Reference", "Today", "Differs by", "Deviations", "Limit")
    yield Table(
        f"changed-numbers-{index}",
        "Each number of today, on average, beside the reference.",
        header,
        rows,
        frozenset({0, 1}),
        legend="Differs by: what flights of one day are off the reference by where nothing changed, one standard "
        "deviation; deviations: today less the reference in these; limit: beyond it has changed; so high for the few "
        "flights that tell what it differs by, and the many numbers that are asked. "
        f"{sentence(number_meanings(record.number))}",
    )
    shows = zip(record.shows.cause, record.shows.smallest.tolist(), strict=True)
    caption = "The smallest change of each kind that shows in 9 of 10 days like this one."
    yield Table(
        f"changed-shows-{index}",
        caption,
        ("Change", "Shows from"),
        [[name, smallest_words(name, size, vehicle) if np.isfinite(size) else "—"] for name, size in shows],
        frozenset({0, 1}),
    )


def natural_unit(name: str) -> str | None:
    """Give the unit of what a number is the logarithm of; None where it is none."""
    kind, _, rest = name.partition(" ")
    return _NATURAL.get(kind, _NATURAL.get(f"{kind} {rest.rpartition(' ')[0]}"))


def changed_blocks(changed: Source[ChangedRecord], index: int) -> Iterator[Block]:
    """Show beside the answer on a page: since when, what to check, the picture, and all numbers."""
    record, vehicle = changed.record, changed.vehicle
    yield Heading(changed.label)
    yield Facts(list(_facts(record, vehicle)))
    yield changed_figure(f"changed-{index}", record)
    yield from _tables(record, vehicle, index)
    # A flight that is not there changes the answer.
    yield from (Text(words, "warning", always=words.startswith(LEFT_OUT)) for words in record.warning)


def changed_figure(name: str, record: ChangedRecord) -> Plot:
    """Draw each number of today's flights over the band of the reference, in deviations."""
    names = list(record.number)
    places = _places(names)
    today, before = record.apart / record.deviation, record.scatter / record.deviation
    more = max(0, len(today) - len(_MARKERS))
    columns = 1 if max(map(len, record.today)) > _LONG else 4
    height = _HEAD + _ROW * (float(places[-1]) + 1 + (min(len(today), len(_MARKERS)) + 3) / columns)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.axvspan(-2.0, 2.0, label="two deviations", **_BAND)
        axes.axvline(0.0, **BASELINE)
        axes.plot(before.ravel(), np.tile(places, len(before)), label="reference", **_REFERENCE)
        for marker, own, label in zip(_MARKERS, today, record.today, strict=False):
            axes.plot(own, places, marker=marker, label=label, **_TODAY)
        if more:
            axes.plot(today[-more:].ravel(), np.tile(places, more), marker="x", label=f"{more} more", **_TODAY)
        axes.set_yticks(places, names)
        axes.invert_yaxis()
        axes.set_xlabel("deviations from the reference")
        axes.grid(visible=False, axis="y")
        legend_over(figure, axes, columns)

    caption = (
        "Each number of today's flights over what the reference flights tell, in deviations: grey the two deviations "
        "in which nearly all days lie where nothing changed, and the reference flights themselves."
    )
    description = "Numbers of today's flights in deviations from the reference, by kind"
    return plot(name, caption, description, height, draw)


def _places(names: Sequence[str]) -> Array:
    """Give each number a row, and each kind some room before it."""
    kinds = [name.split()[0] for name in names]
    new = [0.0, *(0.6 * (one != other) for one, other in zip(kinds[1:], kinds[:-1], strict=True))]
    return np.asarray(np.arange(len(names)) + np.cumsum(new))
