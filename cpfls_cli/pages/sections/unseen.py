"""What the flights could not have shown."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.pages.gap_words import effect_title, sentence
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Block, Section, Table, Text


def unseen_section(sources: Sources) -> Section | None:
    """List the effects that could be there unseen, with the reason or the flight that would show them.

    Returns
    -------
    Section or None
        None where neither a disagreement nor a diagnosis was given.
    """
    given: list[Source] = [*sources.diagnoses, *sources.disagreements]
    if not given:
        return None
    distinct = {tuple(_rows(source)): source for source in reversed(given)}
    blocks: list[Block] = [
        _table(source, index) if rows else Text(f"{source.label}: every effect of the catalogue would have shown.")
        for index, (rows, source) in enumerate(reversed(distinct.items()), start=1)
    ]
    return Section("unseen", "What these flights cannot show", blocks)


def _rows(source: Source) -> Iterator[tuple[str, str, str]]:
    artifact = source.artifact
    names, reasons = artifact.texts("not_excited/name"), artifact.texts("not_excited/reason")
    for name, reason in zip(names, reasons, strict=True):
        yield effect_title(name), name, sentence(reason)


def _table(source: Source, index: int) -> Table:
    caption = f"Effects that could be there without {source.label} knowing, and why: what the logs lack, or how to fly."
    header = ("Effect", "Identifier", "Why, or what to fly")
    return Table(f"unseen-{index}", caption, header, list(_rows(source)), frozenset({0, 1, 2}), frozenset({0, 2}))
