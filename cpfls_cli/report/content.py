"""What a command has to say: text, facts, tables, figures and details for people, a summary for machines."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Tone = Literal["plain", "note", "good", "warning", "unsure"]
"""How much something stands out."""


class Form(StrEnum):
    """What a report is written as."""

    HTML = "html"
    MARKDOWN = "md"
    JSON = "json"


STRUCK = re.compile(r"~~([^~]*)~~(?= impossible)")
"""A number in a text that is struck through; the word behind it says the same where nothing can be struck."""


def impossible(number: str) -> str:
    """Mark a number that no vehicle has."""
    return f"~~{number}~~ impossible"


@dataclass(frozen=True)
class Text:
    """A paragraph.

    Attributes
    ----------
    always : bool
        Of one that warns: whether a terminal shows it however many others there are.
    """

    text: str
    tone: Tone = "plain"
    always: bool = False
    kind: ClassVar[str] = "text"


@dataclass(frozen=True)
class Facts:
    """Terms with their values."""

    rows: Sequence[tuple[str, str]]
    kind: ClassVar[str] = "facts"


@dataclass(frozen=True)
class Cell:
    """A cell of a table that stands out."""

    text: str
    tone: Tone = "plain"


@dataclass(frozen=True)
class Table:
    """A table, with a name that is unique on the page; its first column names the rows.

    Attributes
    ----------
    words : frozenset of int
        Columns that are aligned left; all others hold numbers.
    sentences : frozenset of int
        Columns of long text, which is broken into lines.
    legend : str
        What its columns mean: behind the caption on a page, on a terminal on request.
    """

    name: str
    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str | Cell]]
    words: frozenset[int] = frozenset({0})
    sentences: frozenset[int] = frozenset()
    legend: str = ""
    kind: ClassVar[str] = "table"

    @property
    def explained(self) -> str:
        """The caption with the legend."""
        return f"{self.caption} {self.legend}".strip()

    def part(self, name: str, *columns: int) -> Table:
        """Take some of its columns, without a caption."""
        header, rows = ([self.header[each] for each in columns], [[row[each] for each in columns] for row in self.rows])
        words, sentences = (
            frozenset(new for new, old in enumerate(columns) if old in chosen)
            for chosen in (self.words, self.sentences)
        )
        return Table(name, "", header, rows, words, sentences)

    @property
    def cells(self) -> list[list[Cell]]:
        """All rows with every entry as a cell."""
        return [[entry if isinstance(entry, Cell) else Cell(entry) for entry in row] for row in self.rows]


class Picture(Protocol):
    """A figure that is drawn when somebody asks what it looks like: not every form of a page shows it."""

    @property
    def svg(self) -> str:
        """One ``svg`` element without external references."""
        ...

    @property
    def rows(self) -> Sequence[tuple[str, ...]]:
        """What it draws, for who does not see it: panel, curve, x, y."""
        ...

    def figure(self) -> Figure:
        """Draw it for whoever goes on with it."""
        ...


@dataclass(frozen=True)
class Plot:
    """A figure, with a name that is unique on the page, and a description for those who do not see it.

    Attributes
    ----------
    see : tuple of (str, str), or None
        Where on the page more is said of it: an anchor, and the words that lead there.
    """

    name: str
    caption: str
    picture: Picture
    description: str = ""
    see: tuple[str, str] | None = None
    kind: ClassVar[str] = "plot"


@dataclass(frozen=True)
class Listing:
    """Verbatim text."""

    text: str
    kind: ClassVar[str] = "listing"


@dataclass(frozen=True)
class Folded:
    """Blocks that only some readers want: a page folds them away, a terminal names them and shows them on request.

    Attributes
    ----------
    summary : str
        What they are, in a few words.
    shown : bool
        Whether a page shows them open.
    """

    summary: str
    blocks: Sequence[Block]
    shown: bool = False
    kind: ClassVar[str] = "folded"


@dataclass(frozen=True)
class Heading:
    """A heading inside a section."""

    text: str
    kind: ClassVar[str] = "heading"


@dataclass(frozen=True)
class Box:
    """What a reader must see first; its label is one word, such as the name of a verdict."""

    label: str
    title: str
    sentences: Sequence[str]
    tone: Tone = "note"
    kind: ClassVar[str] = "box"


Block = Box | Text | Facts | Table | Plot | Listing | Folded | Heading


def unfolded(blocks: Iterable[Block]) -> Iterator[Block]:
    """List blocks with those folded away in their place."""
    for block in blocks:
        yield from unfolded(block.blocks) if isinstance(block, Folded) else (block,)


@dataclass(frozen=True)
class Section:
    """One section of the page; its name is the anchor."""

    name: str
    title: str
    blocks: Sequence[Block]

    @property
    def plots(self) -> list[str]:
        """Names of its plots, also of those folded away, in order."""
        return [block.name for block in unfolded(self.blocks) if isinstance(block, Plot)]

    @property
    def tables(self) -> list[str]:
        """Names of its tables, also of those folded away, in order."""
        return [block.name for block in unfolded(self.blocks) if isinstance(block, Table)]


Command = Sequence[str | Path]
"""Words of a command line; a string is what a person does by hand."""


def command_line(command: Command) -> str:
    """Write a command so that it can be pasted, and what is done by hand as it is."""
    return command if isinstance(command, str) else shlex.join(map(str, command))


@dataclass(frozen=True)
class Outcome:
    """What a command has to say.

    Attributes
    ----------
    summary : mapping
        For machines (``--json``).
    blocks : tuple of Block
        For people, on standard output; texts of tone ``warning`` go to standard error.
    exit_code : int
        Not 0 where the work was stopped.
    next : tuple of Command
        To go on with, with the names of this run.
    written : Path or None
        File or folder that the command wrote.
    """

    summary: Mapping[str, Any]
    blocks: tuple[Block, ...] = ()
    exit_code: int = 0
    next: tuple[Command, ...] = ()
    written: Path | None = None


def caution_texts(cautions: Iterable[str]) -> Iterator[Text]:
    """Write what speaks against a model: the first is seen however many notes there are."""
    return (Text(each, "warning", always=index == 0) for index, each in enumerate(cautions))
