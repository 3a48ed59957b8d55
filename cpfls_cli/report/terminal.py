"""Blocks as lines of a terminal: sentences and tables; figures and what is folded away stay on the page."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence

from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text as RichText

from cpfls_cli.errors import visible
from cpfls_cli.report.content import Block, Box, Facts, Folded, Heading, Listing, Plot, Table, Text, Tone

_STYLES: dict[Tone, str] = {"plain": "", "note": "", "good": "green", "warning": "bold red"}
# Where nothing is a terminal no line is cut or folded, so that other programs can read it.
_UNLIMITED = 100_000


def terminal_lines(blocks: Iterable[Block], width: int | None = None, *, colour: bool = False) -> Iterator[str]:
    """Write blocks as lines; texts that warn are left to `warnings_of`.

    Parameters
    ----------
    width : int or None
        Columns of the terminal; None where there is none and lines are as long as they are.
    """
    for block in blocks:
        match block:
            case Text() if block.tone == "warning":
                pass
            case Text() | Heading():
                yield visible(block.text)
            case Box():
                yield visible(f"{block.label}: {block.title}")
                yield from (visible(f"  {sentence}") for sentence in block.sentences)
            case Facts():
                drawn = _grid(colour, header=False)
                drawn.add_column(no_wrap=True)
                drawn.add_column(no_wrap=width is None)
                for term, value in block.rows:
                    drawn.add_row(RichText(visible(term)), RichText(visible(value)))
                yield from _printed(drawn, width, colour)
            case Table():
                yield from _table(block, width, colour)
            case Listing():
                yield from visible(block.text.rstrip()).split("\n")
            case Plot() | Folded():
                pass


def warnings_of(blocks: Iterable[Block]) -> tuple[str, ...]:
    """List the texts that warn."""
    return tuple(block.text for block in blocks if isinstance(block, Text) and block.tone == "warning")


def _table(table: Table, width: int | None, colour: bool) -> Iterator[str]:
    if table.caption:
        yield visible(table.caption)
    drawn = _grid(colour, header=any(table.header))
    for column, title in enumerate(table.header):
        left = column in table.words or column in table.sentences
        texts = [title, *(visible(row[column].text) for row in table.cells)]
        drawn.add_column(
            RichText(visible(title)),
            justify="left" if left else "right",
            no_wrap=width is None,
            min_width=max((len(word) for text in texts for word in text.split()), default=0),
        )
    for row in table.cells:
        drawn.add_row(*(RichText(visible(cell.text), _STYLES[cell.tone] if colour else "") for cell in row))
    lines = _printed(drawn, width, colour)
    # No word is broken; what that takes beyond the width, other columns have to give.
    excess = max((RichText.from_ansi(line).cell_len for line in lines), default=0) - (width or _UNLIMITED)
    yield from _printed(drawn, width - excess, colour) if width and excess > 0 else lines


def _grid(colour: bool, *, header: bool) -> RichTable:
    style = "bold" if colour else ""
    return RichTable(box=None, pad_edge=False, padding=(0, 1), show_header=header, header_style=style)


def _printed(drawn: RichTable, width: int | None, colour: bool) -> Sequence[str]:
    stream = io.StringIO()
    console = Console(
        file=stream,
        width=width or _UNLIMITED,
        force_terminal=colour,
        # In a notebook rich would show a table by itself, beside the text that it is a part of.
        force_jupyter=False,
        color_system="standard" if colour else None,
        markup=False,
        emoji=False,
        highlight=False,
    )
    console.print(drawn, crop=False)
    return [line.rstrip() for line in stream.getvalue().splitlines()]
