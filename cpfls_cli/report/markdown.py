"""A report as Markdown: text, facts and tables; figures by their captions."""

from __future__ import annotations

import re
from collections.abc import Iterator

from cpfls_cli.errors import visible
from cpfls_cli.report.content import (
    STRUCK,
    Block,
    Box,
    Document,
    Facts,
    Folded,
    Heading,
    Listing,
    Plot,
    Table,
    Text,
    Tone,
)

_SPECIAL = re.compile(r"([\\`*_\[\]|~#$])")
_BEGINS = re.compile(r"^(\d+)([.)])(?=\s|$)|^([-+=])")
_TONES: dict[Tone, str] = {"note": "Note", "good": "Good", "warning": "Warning", "unsure": "Not known"}


def markdown_page(document: Document) -> str:
    """Write a document as GitHub-flavoured Markdown; nothing in its texts is taken for markup."""
    files = ", ".join(f"{_plain(source.label)} `{source.short_hash}`" for source in document.origins)
    contents = "\n".join(f"- [{_plain(section.title)}](#{section.name})" for section in document.sections)
    parts = [f"# {_plain(document.title)}", f"Made by cpfls {_plain(document.version)} from {files}.", contents]
    for section in document.sections:
        parts.append(f'<a id="{section.name}"></a>\n\n## {_plain(section.title)}')
        parts += [part for block in section.blocks for part in _block(block)]
    return "\n\n".join(parts) + "\n"


def _block(block: Block) -> Iterator[str]:
    match block:
        case Heading():
            yield f"### {_plain(block.text)}"
        case Text():
            yield f"> **{_TONES[block.tone]}.** {_plain(block.text)}" if block.tone in _TONES else _plain(block.text)
        case Box():
            yield "\n>\n> ".join([f"> **{_plain(block.label)}: {_plain(block.title)}**", *map(_plain, block.sentences)])
        case Facts():
            yield "\n".join(f"- **{_plain(term)}**: {_plain(value)}" for term, value in block.rows)
        case Table():
            yield from _table(block)
        case Folded():
            yield f"**{_plain(block.summary)}**"
            for inner in block.blocks:
                yield from _block(inner)
        case Plot():
            yield f"*{_plain(block.caption)}*"
            seen = f"Figure `{block.name}`: {_plain(block.description)}."
            yield f"> {seen} It is drawn in the HTML form of this report; the JSON form holds its data."
        case Listing():
            fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", block.text)), default=0))
            yield f"**{_plain(block.summary)}**"
            yield f"{fence}text\n{block.text.rstrip()}\n{fence}"


def _table(table: Table) -> Iterator[str]:
    yield f'<a id="{table.name}"></a>{_plain(table.explained)}'
    rules = [":--" if column in table.words else "--:" for column in range(len(table.header))]
    rows = [[_marked(cell.text, cell.tone) for cell in row] for row in table.cells]
    yield "\n".join(f"| {' | '.join(row)} |" for row in [list(map(_plain, table.header)), rules, *rows])


def _marked(text: str, tone: Tone) -> str:
    return f"**{_plain(text)}**" if tone != "plain" and text.strip() else _plain(text)


def _plain(text: str) -> str:
    """Write text so that nothing in it is markup."""
    line = " ".join(visible(text).split()).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    parts = [_SPECIAL.sub(r"\\\1", part) for part in STRUCK.split(line)]
    # Every second one is struck through.
    line = "".join(f"~~{part}~~" if place % 2 else part for place, part in enumerate(parts))
    return _BEGINS.sub(lambda m: f"{m[1]}\\{m[2]}" if m[1] else f"\\{m[3]}", line)
