"""What the flights of a comparison can and cannot show: their sensors, and the effects that would stay unseen."""

from __future__ import annotations

import logging
from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any

from cpfls_cli.artifacts.audit import AuditGroup
from cpfls_cli.artifacts.gap_flights import NotExcitedGroup
from cpfls_cli.consistency.findings import as_contradiction
from cpfls_cli.pages.effects import effect_title, measured, titles, unit_words
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Block, Box, Folded, Heading, Section, Table, Text
from cpfls_cli.report.numbers import probability, sentence
from cpfls_cli.words import joined

_SENSORS, _UNSEEN = "Sensors", "What these flights cannot show"


def sensors_answer(audit: AuditGroup) -> Iterator[Block]:
    """Say what the sensors say about each other, faults first; broken channels are left to `sensor_warnings`."""
    said = list(_faults(audit))
    yield from (each for each in said if isinstance(each, Box))
    rest = [each for each in said if not isinstance(each, Box)]
    yield from [Folded("sensors", rest)] if rest else []


def settled_channels(audit: AuditGroup) -> Iterator[Text]:
    """Say which channels contradict the others, and what is done about them."""
    return (Text(repair, "warning", always=True) for repair in audit.settled)


def contradicted(first: str) -> str:
    """Say before anything else that a log contradicts itself or its config, and where it does so first."""
    return sentence(as_contradiction(sentence(first)))


NOTHING_COMES = (
    "Nothing is searched, for nothing found could be used. Correct what is wrong, in the section `import` of the "
    "config or in `vehicle`, or leave that flight out; --anyway searches all the same."
)
"""What to do about logs that contradict themselves."""


def tell_before_search(contradictions: Sequence[str]) -> None:
    """Say at once, above the progress, that what a long search finds cannot be used."""
    if contradictions:
        logging.getLogger("cpfls_cli").warning("%s No model found in it can be used.", contradicted(contradictions[0]))


def _faults(audit: AuditGroup) -> Iterator[Block]:
    for fault in audit.faults:
        yield Box("SENSOR FAULT", f"{fault} The diagnosis repairs it before it looks at the model.", [], "warning")
    if audit.finding and not (audit.faults or audit.settled or audit.contradiction):
        yield Text("The sensors agree with each other: no fault that matters.", "good")
    for reason, names in audit.untested_by_reason.items():
        yield Text(f"Not tested for {joined(titles(names))}: {reason.rstrip('.')}.")
    yield from (Text(sentence(note)) for note in audit.note)


def sensor_warnings(audit: AuditGroup) -> Iterator[Text]:
    """Warn of channels that disagree or look broken."""
    return (Text(warning, "warning", always=True) for warning in audit.warning)


def sensors_section(sources: Sources) -> Section | None:
    """Show the audits of the sensors, equal ones once, where anything of the gap workflow was given."""
    shown = _distinct(sources.gap, lambda record: _words(record.audit))
    blocks: list[Block] = []
    for index, source in enumerate(shown, start=1):
        audit = source.record.audit
        blocks += [Heading(source.label)] if len(shown) > 1 else []
        # No verdict can stand beside a log that contradicts itself.
        blocks += [Text(contradicted(each), "warning") for each in audit.contradiction or ()]
        blocks += [*settled_channels(audit), *_faults(audit), *sensor_warnings(audit)]
        blocks += [_numbers(audit, f"sensor-numbers-{index}")] if audit.coefficient.name else []
    return Section("sensors", _SENSORS, blocks) if blocks else None


def _distinct(sources: Sequence[Source[Any]], told: Callable[[Any], Hashable]) -> list[Source[Any]]:
    """List artifacts without those that tell the same as one before."""
    distinct = {told(source.record): source for source in reversed(sources)}
    return list(reversed(distinct.values()))


def _words(audit: AuditGroup) -> tuple[str, ...]:
    return (*(audit.contradiction or ()), *audit.settled, *audit.sentence, *audit.untested, *audit.warning, *audit.note)


def _numbers(audit: AuditGroup, name: str) -> Table:
    rows = [
        [
            effect_title(finding.name),
            number.name,
            *measured(number.value, number.low, number.high),
            unit_words(number.unit),
            probability(finding.p_value),
        ]
        for finding in audit.findings
        for number in finding.coefficients
    ]
    caption = "What was measured of each fault, whether it matters or not, with 95 % intervals."
    header = ("Fault", "Number", "Value", "95 % interval", "Unit", "p")
    return Table(name, caption, header, rows, frozenset({0, 1, 4}))


def unseen_answer(unseen: NotExcitedGroup) -> Iterator[Block]:
    """List the effects that could be there unseen, those of one reason together, and what would show them."""
    if unseen.name:
        yield Folded(f"{_UNSEEN[:1].lower()}{_UNSEEN[1:]}", [_unseen_table("unseen", unseen, "")])


def unseen_section(sources: Sources) -> Section | None:
    """List the effects that could be there unseen, where a disagreement or a diagnosis was given."""
    given: list[Source[Any]] = [*sources.diagnoses, *sources.disagreements]
    blocks: list[Block] = []
    for index, source in enumerate(_distinct(given, lambda record: _rows(record.not_excited)), start=1):
        unseen = source.record.not_excited
        why = (
            f"Effects that {source.label} could not show, and why: what the logs lack, or which flight would show them."
        )
        nothing = Text(f"{source.label}: every effect of the catalogue would have shown.")
        blocks.append(_unseen_table(f"unseen-{index}", unseen, why) if unseen.name else nothing)
    return Section("unseen", _UNSEEN, blocks) if blocks else None


def _unseen_table(name: str, unseen: NotExcitedGroup, caption: str) -> Table:
    header = ("Effects", "Identifiers", "Why, or what to fly")
    return Table(name, caption, header, _rows(unseen), frozenset({0, 1, 2}), frozenset({0, 1, 2}))


def _rows(unseen: NotExcitedGroup) -> tuple[tuple[str, str, str], ...]:
    return tuple(
        (joined(titles(names)), ", ".join(names), sentence(reason)) for reason, names in unseen.by_reason.items()
    )
