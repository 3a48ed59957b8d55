"""Blocks as lines of a terminal: sentences and tables; figures and what is folded away stay on the page."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from cpfls_cli.errors import visible
from cpfls_cli.report.content import (
    STRUCK,
    Block,
    Box,
    Facts,
    Folded,
    Heading,
    Listing,
    Plot,
    Table,
    Text,
    Tone,
    unfolded,
)
from cpfls_cli.words import broken

if TYPE_CHECKING:
    from rich.table import Table as RichTable
    from rich.text import Text as RichText

# Rich is loaded where there is a table: sentences do not wait for it.
_STYLES: dict[Tone, str] = {"plain": "", "note": "", "good": "green", "warning": "bold red", "unsure": "bold magenta"}
# Where nothing is a terminal no number or word is cut or folded, so that other programs can read it.
_UNLIMITED = 100_000
# Wider tables are hard to read: their sentences are broken.
_WIDEST = 100


def terminal_lines(
    blocks: Iterable[Block], width: int | None = None, *, colour: bool = False, whole: bool = False
) -> Iterator[str]:
    """Write blocks as lines; texts that warn are left to `warnings_of`.

    Parameters
    ----------
    width : int or None
        Columns of the terminal; None where there is none and lines are as long as they are.
    whole : bool
        Show what is folded away too, but figures.
    """
    for block in blocks:
        match block:
            case Text() if block.tone == "warning":
                pass
            case Text() | Heading():
                yield from broken(visible(block.text), width)
            case Box():
                yield from broken(visible(f"{block.label}: {block.title}"), width)
                for each in block.sentences:
                    yield from broken(visible(each), width, "  ")
            case Facts():
                drawn = _grid(colour, header=False)
                drawn.add_column(no_wrap=True)
                drawn.add_column(no_wrap=width is None)
                for term, value in block.rows:
                    drawn.add_row(_rich(visible(term)), _rich(visible(value)))
                yield from _printed(drawn, width, colour)
            case Table():
                yield from _table(block, width, colour)
            case Listing():
                yield from visible(block.text.rstrip()).split("\n")
            case Folded() if whole and _says_something(block):
                yield from broken(visible(f"{block.summary}:"), width)
                yield from terminal_lines(block.blocks, width, colour=colour, whole=True)
            case Plot() | Folded():
                pass


def folded_words(blocks: Iterable[Block]) -> tuple[str, ...]:
    """Say what is folded away."""
    return tuple(dict.fromkeys(each.summary for each in blocks if isinstance(each, Folded) and _says_something(each)))


def _says_something(block: Block) -> bool:
    """Tell whether a block has lines: figures have none, and texts that warn stand elsewhere."""
    if isinstance(block, Folded):
        return any(map(_says_something, block.blocks))
    return not isinstance(block, Plot) and not (isinstance(block, Text) and block.tone == "warning")


def warnings_of(blocks: Iterable[Block]) -> tuple[Text, ...]:
    """List the texts that warn, also of those folded away."""
    return tuple(block for block in unfolded(blocks) if isinstance(block, Text) and block.tone == "warning")


def _table(table: Table, width: int | None, colour: bool) -> Iterator[str]:
    if table.caption:
        yield from broken(visible(table.caption), width)
    lines = _printed(_drawn(table, colour, unbroken=width is None), width, colour)
    if width is None and _widest(lines) > _WIDEST and table.sentences:
        excess = _widest(lines) - _WIDEST
        lines = _printed(_drawn(table, colour, unbroken=True, excess=excess), width, colour)
    if width is not None and _widest(lines) > width:
        # No word is broken; what that takes beyond the width, other columns have to give.
        lines = _printed(_drawn(table, colour), 2 * width - _widest(lines), colour)
    if width is not None and _widest(lines) > width:
        lines = _printed(_drawn(table, colour, words=False), width, colour)
    yield from lines


def _widest(lines: Iterable[str]) -> int:
    from rich.text import Text as RichText

    return max((RichText.from_ansi(line).cell_len for line in lines), default=0)


def _drawn(table: Table, colour: bool, *, unbroken: bool = False, words: bool = True, excess: int = 0) -> RichTable:
    """Lay out a table, too wide by `excess` columns, which its sentences give.

    `unbroken`: all but sentences stand on one line, as numbers always do; `words`: words stay whole.
    """
    drawn = _grid(colour, header=any(table.header))
    cells = [[STRUCK.sub(r"\1", visible(cell.text)) for cell in row] for row in table.cells]
    texts = [[visible(title), *(row[column] for row in cells)] for column, title in enumerate(table.header)]
    long = _narrowed(texts, table.sentences, excess)
    for column, (title, *entries) in enumerate(texts):
        left = column in table.words or column in table.sentences
        parts = [title, *entries] if left else [title]
        least = max((len(word) for part in parts for word in part.split()), default=0)
        least = least if left else max(least, *map(len, entries), 0)
        drawn.add_column(
            _rich(title),
            justify="left" if left else "right",
            no_wrap=unbroken and column not in long,
            overflow="fold",
            min_width=least if words or not left else None,
            max_width=long.get(column) if excess else None,
        )
    for row in table.cells:
        drawn.add_row(*(_rich(visible(cell.text), _STYLES[cell.tone] if colour else "") for cell in row))
    return drawn


def _narrowed(texts: Sequence[Sequence[str]], sentences: Iterable[int], excess: int) -> dict[int, int]:
    """Give the widths of columns of sentences from which some is taken, always of the widest, down to its words."""
    widths = {column: max(map(len, texts[column])) for column in sentences}
    least = {column: max(len(word) for text in texts[column] for word in (text.split() or [""])) for column in widths}
    for _ in range(excess):
        wide = [column for column in widths if widths[column] > least[column]]
        if wide:
            widths[max(wide, key=widths.__getitem__)] -= 1
    return widths


def _rich(text: str, style: str = "") -> RichText:
    from rich.text import Text as RichText

    # Every second part is struck through, where a terminal can.
    parts = STRUCK.split(text)
    return RichText.assemble(*((part, f"{style} strike" if at % 2 else style) for at, part in enumerate(parts)))


def _grid(colour: bool, *, header: bool) -> RichTable:
    from rich.table import Table as RichTable

    style = "bold" if colour else ""
    return RichTable(box=None, pad_edge=False, padding=(0, 1), show_header=header, header_style=style)


def _printed(drawn: RichTable, width: int | None, colour: bool) -> Sequence[str]:
    from rich.console import Console

    stream = io.StringIO()
    console = Console(
        file=stream,
        width=width or _UNLIMITED,
        force_terminal=colour,
        # In a notebook rich would show a table by itself, apart from the text that it is a part of.
        force_jupyter=False,
        color_system="standard" if colour else None,
        markup=False,
        emoji=False,
        highlight=False,
    )
    console.print(drawn, crop=False)
    return [line.rstrip() for line in stream.getvalue().splitlines()]
