"""What the sensors of the flights say about each other."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.pages.gap_words import effect_title, joined, probability, sentence, unit_words
from cpfls_cli.pages.sections.gap_tables import measured
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Block, Heading, Section, Table, Text


def sensors_section(sources: Sources) -> Section | None:
    """Show the audit of the sensors, each once.

    Returns
    -------
    Section or None
        None where nothing of the gap workflow was given.
    """
    distinct = {_said(source): source for source in reversed(sources.gap)}
    blocks: list[Block] = []
    for index, source in enumerate(reversed(distinct.values()), start=1):
        blocks += [Heading(source.label)] if len(distinct) > 1 else []
        blocks += _audit(source, index)
    return Section("sensors", "Sensors", blocks) if blocks else None


def _said(source: Source) -> tuple[str, ...]:
    keys = ("sentence", "untested", "warning", "note")
    return tuple(text for key in keys for text in source.artifact.texts(f"audit/{key}"))


def _audit(source: Source, index: int) -> Iterator[Block]:
    artifact = source.artifact
    findings = artifact.texts("audit/finding")
    named = artifact.array("audit/named")
    for told, sure in zip(artifact.texts("audit/sentence"), named, strict=True):
        if sure:
            yield Text(f"{told} The diagnosis repairs it before it looks at the model.", "warning")
    if findings and not named.any():
        yield Text("The sensors agree with each other: no fault that matters.", "good")
    yield from [Text(text) for text in _untested(source)]
    yield from [Text(sentence(warning), "warning") for warning in artifact.texts("audit/warning")]
    yield from [Text(sentence(note)) for note in artifact.texts("audit/note")]
    if artifact.texts("audit_coefficient/name"):
        yield _numbers(source, index)


def _untested(source: Source) -> Iterator[str]:
    reasons: dict[str, list[str]] = {}
    for text in source.artifact.texts("audit/untested"):
        name, _, reason = text.partition(": ")
        reasons.setdefault(reason, []).append(effect_title(name))
    for reason, names in reasons.items():
        yield f"Not tested for {joined(names)}: {reason.rstrip('.')}."


def _numbers(source: Source, index: int) -> Table:
    artifact = source.artifact
    chance = dict(zip(artifact.texts("audit/finding"), artifact.array("audit/p_value"), strict=True))
    words = (artifact.texts(f"audit_coefficient/{key}") for key in ("finding", "name", "unit"))
    values = (artifact.array(f"audit_coefficient/{key}") for key in ("value", "low", "high"))
    rows = [
        [
            effect_title(finding),
            name,
            *measured(value, low, high),
            unit_words(unit),
            probability(chance[finding]),
        ]
        for finding, name, unit, value, low, high in zip(*words, *values, strict=True)
    ]
    caption = "What was measured of each fault, whether it matters or not, with 95 % intervals."
    header = ("Fault", "Number", "Value", "95 % interval", "Unit", "p")
    return Table(f"sensor-numbers-{index}", caption, header, rows, frozenset({0, 1, 4}))
